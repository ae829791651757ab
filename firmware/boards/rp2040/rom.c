/* What this chip's boot ROM is asked in its own way (data sheet 2.8.3), and the unique number of the flash chip. */
#include "board.h"
#include "flash.h"
#include "registers.h"

#define READ_UNIQUE_ID 0x4bu

extern const uint16_t rom_function_table, rom_table_lookup;

typedef void *lookup(const uint16_t *table, uint32_t code);
typedef void usb_boot(uint32_t activity_pins, uint32_t disable);

static uint32_t rom_pointer(const uint16_t *address)
{
    return *(const volatile uint16_t *)address;
}

void *rom_function(char first, char second)
{
    lookup *find = (lookup *)rom_pointer(&rom_table_lookup);
    return find((const uint16_t *)rom_pointer(&rom_function_table), (uint32_t)first | (uint32_t)second << 8);
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
