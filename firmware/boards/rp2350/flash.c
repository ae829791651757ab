/*
 * Flash through the functions of the boot ROM (data sheet 5.4.8). While the flash does not answer reads nothing may run
 * from it: all code is in RAM, and interrupts are off.
 */
#include "board.h"
#include "registers.h"

#include "bytes.h"

#define FLASH_BASE 0x10000000u
#define CONFIG_OFFSET (2048u * 1024u - PORT_SECTORS * PORT_SECTOR_BYTES)
#define SECTOR_ERASE 0x20u
#define FOR_SECURE_ARM 0x0004u
#define CHIP_INFO 0x0001u            /* of get_sys_info: package, then the device's number */
#define REBOOT_TO_BOOTSEL 0x0102u    /* and the function does not return */
#define REBOOT_AFTER_MS 10u

extern const uint16_t rom_table_lookup;

typedef void *lookup(uint32_t code, uint32_t mask);
typedef void procedure(void);
typedef void erase(uint32_t offset, uint32_t count, uint32_t block, uint8_t command);
typedef void program(uint32_t offset, const uint8_t *bytes, uint32_t count);
typedef int system_information(uint32_t *words, uint32_t count, uint32_t flags);
typedef int reboot(uint32_t flags, uint32_t delay_ms, uint32_t first, uint32_t second);

static void *rom_function(char first, char second)
{
    lookup *find = (lookup *)(uint32_t) * (const volatile uint16_t *)&rom_table_lookup;
    return find((uint32_t)first | (uint32_t)second << 8, FOR_SECURE_ARM);
}

struct access {
    procedure *flush, *enter_xip;
    uint32_t interrupts;
};

static struct access access_begin(void)
{
    procedure *connect = (procedure *)rom_function('I', 'F'), *leave_xip = (procedure *)rom_function('E', 'X');
    struct access access = {
        .flush = (procedure *)rom_function('F', 'C'),
        .enter_xip = (procedure *)rom_function('C', 'X'),
    };
    watchdog_pause();
    access.interrupts = interrupts_off();
    connect();
    leave_xip();
    return access;
}

static void access_end(const struct access *access)
{
    access->flush();
    access->enter_xip();
    usb_frames_missed();
    interrupts_restore(access->interrupts);
    watchdog_feed();
}

void flash_read(void *context, uint32_t offset, void *to, size_t count)
{
    (void)context;
    bytes_copy(to, (const uint8_t *)(FLASH_BASE + CONFIG_OFFSET) + offset, count);
}

bool flash_erase(void *context, uint32_t sector)
{
    (void)context;
    erase *run = (erase *)rom_function('R', 'E');
    struct access access = access_begin();
    run(CONFIG_OFFSET + sector * PORT_SECTOR_BYTES, PORT_SECTOR_BYTES, PORT_SECTOR_BYTES, SECTOR_ERASE);
    access_end(&access);
    return true;
}

bool flash_program(void *context, uint32_t offset, const uint8_t *page)
{
    (void)context;
    program *run = (program *)rom_function('R', 'P');
    struct access access = access_begin();
    run(CONFIG_OFFSET + offset, page, PORT_PAGE_BYTES);
    access_end(&access);
    return true;
}

/* The chip has a number of its own, so the flash is not asked. */
void flash_unique_id(uint8_t unique_id[8])
{
    uint32_t words[4] = {0};
    system_information *ask = (system_information *)rom_function('G', 'S');
    ask(words, 4, CHIP_INFO);
    for (uint32_t i = 0; i < 8; i++)
        unique_id[i] = (uint8_t)(words[3u - i / 4u] >> (24u - 8u * (i % 4u)));
}

void flash_bootloader(void)
{
    reboot *run = (reboot *)rom_function('R', 'B');
    interrupts_off();
    watchdog_forget();
    run(REBOOT_TO_BOOTSEL, REBOOT_AFTER_MS, 0, 0);
    for (;;)
        ;
}
