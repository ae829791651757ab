/* What this chip's boot ROM is asked in its own way (data sheet 5.4). */
#include "board.h"
#include "flash.h"
#include "registers.h"

#define FOR_SECURE_ARM 0x0004u
#define CHIP_INFO 0x0001u            /* of get_sys_info: package, then the device's number */
#define REBOOT_TO_BOOTSEL 0x0102u    /* and the function does not return */
#define REBOOT_AFTER_MS 10u

extern const uint16_t rom_table_lookup;

typedef void *lookup(uint32_t code, uint32_t mask);
typedef int system_information(uint32_t *words, uint32_t count, uint32_t flags);
typedef int reboot(uint32_t flags, uint32_t delay_ms, uint32_t first, uint32_t second);

void *rom_function(char first, char second)
{
    lookup *find = (lookup *)(uint32_t) * (const volatile uint16_t *)&rom_table_lookup;
    return find((uint32_t)first | (uint32_t)second << 8, FOR_SECURE_ARM);
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
