/*
 * Flash through the functions of the boot ROM (2.8.3.1.3). While the flash does not answer reads nothing may run
 * from it: all code is in RAM, and interrupts are off.
 */
#include "board.h"
#include "registers.h"

#include "bytes.h"

#define FLASH_BASE 0x10000000u
#define CONFIG_OFFSET (2048u * 1024u - PORT_SECTORS * PORT_SECTOR_BYTES)
#define SECTOR_ERASE 0x20u
#define READ_UNIQUE_ID 0x4bu

extern const uint16_t rom_function_table, rom_table_lookup;

typedef void *lookup(const uint16_t *table, uint32_t code);
typedef void procedure(void);
typedef void erase(uint32_t offset, uint32_t count, uint32_t block, uint8_t command);
typedef void program(uint32_t offset, const uint8_t *bytes, uint32_t count);
typedef void usb_boot(uint32_t activity_pins, uint32_t disable);

static uint32_t rom_pointer(const uint16_t *address)
{
    return *(const volatile uint16_t *)address;
}

static void *rom_function(char first, char second)
{
    lookup *find = (lookup *)rom_pointer(&rom_table_lookup);
    return find((const uint16_t *)rom_pointer(&rom_function_table), (uint32_t)first | (uint32_t)second << 8);
}

struct access {
    procedure *connect, *leave_xip, *flush, *enter_xip;
    uint32_t interrupts;
};

static struct access access_begin(void)
{
    struct access access = {
        .connect = (procedure *)rom_function('I', 'F'),
        .leave_xip = (procedure *)rom_function('E', 'X'),
        .flush = (procedure *)rom_function('F', 'C'),
        .enter_xip = (procedure *)rom_function('C', 'X'),
    };
    watchdog_pause();
    access.interrupts = interrupts_off();
    access.connect();
    access.leave_xip();
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

static uint8_t exchange(uint8_t byte)
{
    while (!(REGISTER(SSI_SR) & 1u << 1)) /* room to send */
        ;
    REGISTER(SSI_DR0) = byte;
    while (!(REGISTER(SSI_SR) & 1u << 3)) /* something came back */
        ;
    return (uint8_t)REGISTER(SSI_DR0);
}

static void chip_select(bool selected)
{
    REGISTER(IO_QSPI_SS_CTRL) = (REGISTER(IO_QSPI_SS_CTRL) & ~0x300u) | (selected ? 0x200u : 0x300u);
}

void flash_unique_id(uint8_t unique_id[8])
{
    struct access access = access_begin();
    REGISTER(SSI_SSIENR) = 0;
    REGISTER(SSI_CTRLR0) = 7u << 16; /* bytes, both ways */
    REGISTER(SSI_BAUDR) = 6;
    REGISTER(SSI_SER) = 1;
    REGISTER(SSI_SSIENR) = 1;
    chip_select(true);
    exchange(READ_UNIQUE_ID);
    for (uint32_t dummy = 0; dummy < 4; dummy++)
        exchange(0);
    for (uint32_t i = 0; i < 8; i++)
        unique_id[i] = exchange(0);
    chip_select(false);
    REGISTER(IO_QSPI_SS_CTRL) &= ~0x300u;
    access_end(&access);
}

void flash_bootloader(void)
{
    usb_boot *run = (usb_boot *)rom_function('U', 'B');
    interrupts_off();
    watchdog_forget();
    run(0, 0);
    for (;;)
        ;
}
