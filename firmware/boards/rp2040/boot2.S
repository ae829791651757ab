@ Second stage of the boot: the ROM checks the CRC of these 256 bytes, copies them to RAM and calls them. They set the
@ flash interface to plain serial reads (03h), which every flash chip knows, and start the image at 0x10000100.
@ clk_sys / 4 is 30 MHz once the image has raised the clock, within what the chips allow for 03h (33 MHz and more). The
@ CRC in the last word is filled in by the build.
    .syntax unified
    .cpu cortex-m0plus
    .thumb
    .section .boot2, "ax"
    .global boot2
boot2:
    ldr r3, =0x18000000         @ SSI
    movs r0, #0
    str r0, [r3, #0x08]         @ SSIENR: off while it is changed
    movs r0, #4
    str r0, [r3, #0x14]         @ BAUDR: clk_sys / 4
    ldr r0, =0x001f0300         @ CTRLR0: 32-bit data frames, read after a command ("EEPROM read")
    str r0, [r3, #0x00]
    movs r0, #0
    str r0, [r3, #0x04]         @ CTRLR1: one data frame
    ldr r0, =0x03000218         @ SPI_CTRLR0: command 03h, 8 bits of command and 24 of address, all on one line
    ldr r1, =0x180000f4
    str r0, [r1]
    movs r0, #1
    str r0, [r3, #0x08]         @ SSIENR: on
    ldr r0, =0x10000100         @ the vectors of the image
    ldr r1, =0xe000ed08         @ VTOR
    str r0, [r1]
    ldr r1, [r0, #0]
    ldr r2, [r0, #4]
    msr msp, r1
    bx r2
    .align 2
    .ltorg
    .org 252
    .word 0
