/*
 * Flash through the functions of the boot ROM (RP2040's data sheet 2.8.3.1.3, RP2350's 5.4.8). While the flash does not
 * answer reads nothing may run from it: all code is in RAM, and interrupts are off.
 */
#include "flash.h"

#include "board.h"
#include "bytes.h"
#include "registers.h"

#define FLASH_BASE 0x10000000u
#define CONFIG_OFFSET (2048u * 1024u - PORT_SECTORS * PORT_SECTOR_BYTES)
#define SECTOR_ERASE 0x20u

typedef void erase(uint32_t offset, uint32_t count, uint32_t block, uint8_t command);
typedef void program(uint32_t offset, const uint8_t *bytes, uint32_t count);

struct access access_begin(void)
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

void access_end(const struct access *access)
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
