"""Faults of the RP2040's code, listed before any of them was tried: how much does the examination really see?

`python -m tests.benchmarks.planted apart` and `... further` plant them. APART is not kept apart any more: what nobody
noticed of it the emulator was taught then. FURTHER was listed before that, and the emulator knows nothing of it.
"""

# ruff: noqa: E501 (a line of C stays one line)

from tests.firmware.helpers.mutations import BOARD, SHARED, Mutation

CLOCK, LIGHT, PINS, USB, CONTROL = (f"{SHARED}/{name}.c" for name in ("clock", "light", "pins", "usb", "usb_control"))

APART = (
    Mutation("the crystal's range is reserved", CLOCK, "REGISTER(XOSC_CTRL) = 0xaa0;", "REGISTER(XOSC_CTRL) = 0xaa3;"),
    Mutation("clk_ref stays on the ring oscillator", CLOCK, "    REGISTER(CLK_REF_CTRL) = 2;                /* crystal */\n    wait_for(CLK_REF_SELECTED, 1u << 2);\n", ""),
    Mutation("lock of the PLL not awaited", CLOCK, "    wait_for(PLL_CS(base), 1u << 31);          /* locked */\n", ""),
    Mutation("post dividers without power", CLOCK, "    CLEAR_BITS(PLL_PWR(base)) = 1u << 3;\n", ""),
    Mutation("processor stays on the crystal", CLOCK, "    SET_BITS(CLK_SYS_CTRL) = 1;\n    wait_for(CLK_SYS_SELECTED, 1u << 1);\n", ""),
    Mutation("end of the resets not awaited", CLOCK, "    while ((REGISTER(RESETS_DONE) & resets) != resets)\n        ;\n", ""),
    Mutation("IO_BANK0 left in reset", CLOCK, "RESET_DMA | RESET_IO_BANK0 |", "RESET_DMA |"),
    Mutation("pads left in reset", CLOCK, "RESET_IO_BANK0 | RESET_PADS_BANK0 |", "RESET_IO_BANK0 |"),
    Mutation("alarm of the trigger output without interrupt", CLOCK, "1u << 0 | 1u << 1 | 1u << 2 | 1u << 3;\n    REGISTER(TIMER_ALARM(1))", "1u << 0 | 1u << 1 | 1u << 3;\n    REGISTER(TIMER_ALARM(1))"),
    Mutation("the temperature sensor has no power", f"{SHARED}/thermometers.c", "1u << 2 | 1u << 1 | 1u << 0;", "1u << 2 | 1u << 0;"),
    Mutation("a tick that comes every 200 ms", CLOCK, "#define TICK_US 10000u", "#define TICK_US 200000u"),
    Mutation("the tick of the timer is 2 us", f"{BOARD}/registers.h", "1u << 9 | 12;", "1u << 9 | 24;"),
    Mutation("the watchdog resets nothing", f"{BOARD}/registers.h", "#define EVERYTHING_BUT_OSCILLATORS 0x0001fffcu", "#define EVERYTHING_BUT_OSCILLATORS 0x00000000u"),
    Mutation("the watchdog is fed with half a millisecond", f"{SHARED}/watchdog.c", "WATCHDOG_COUNTS_A_US * TIMEOUT_US;", "TIMEOUT_US / 100u;"),
    Mutation("a fault leaves the interrupts on", f"{SHARED}/watchdog.c", "    interrupts_off();\n    pins_power(NULL, false);", "    pins_power(NULL, false);"),
    Mutation("what starts at zero is not cleared", f"{SHARED}/start.c", "        *to++ = 0;", "        to++;"),
    Mutation("the last words are not copied to RAM", f"{SHARED}/start.c", "to < &ram_end;", "to < &ram_end - 8;"),
    Mutation("the trigger has no vector", f"{SHARED}/start.c", "    [16 + IRQ_IO_BANK0] = trigger_interrupt,\n", ""),
    Mutation("the vectors stay those of the start", f"{SHARED}/main.c", "    vectors_install();\n", ""),
    Mutation("the program of the PIO wraps too soon", LIGHT, "(PROGRAM_LENGTH - 1u) << 12;", "(PROGRAM_LENGTH - 2u) << 12;"),
    Mutation("bits from the wrong end", LIGHT, "1u << 17 | (bits & 31u)", "1u << 17 | 1u << 19 | (bits & 31u)"),
    Mutation("two pins are side-set", LIGHT, "REGISTER(PIO0_SM0_PINCTRL) = 1u << 29 | data_pin << 10; /*", "REGISTER(PIO0_SM0_PINCTRL) = 2u << 29 | data_pin << 10; /*"),
    Mutation("the DMA moves bytes", LIGHT, "1u << 0 | 2u << 2 | 1u << 4", "1u << 0 | 0u << 2 | 1u << 4"),
    Mutation("the DMA reads the same word", LIGHT, "1u << 0 | 2u << 2 | 1u << 4", "1u << 0 | 2u << 2"),
    Mutation("the DMA waits for another state machine", LIGHT, "DMA_PACED_BY(0u)", "DMA_PACED_BY(1u)"),
    Mutation("the transfer is not aborted at a fault", LIGHT, "    REGISTER(DMA_CHAN_ABORT) = 1u << 0; /*", "    /*"),
    Mutation("an alarm that is pending is not cancelled", LIGHT, "    REGISTER(NVIC_ICPR) = 1u << IRQ_TIMER_0;\n", ""),
    Mutation("falling for rising", PINS, "(falling ? 4u : 8u)", "(falling ? 8u : 4u)"),
    Mutation("the edge of the trigger is not acknowledged", PINS, "    REGISTER(IO_BANK0_INTR(trigger_pin)) = BOTH_EDGES << 4u * (trigger_pin % 8u);\n", ""),
    Mutation("the pulse's alarm is not acknowledged", PINS, "    REGISTER(TIMER_INTR) = 1u << 2;\n    if (pulsing)", "    if (pulsing)"),
    Mutation("outputs are not enabled", PINS, "    REGISTER(SIO_ENABLE_SET) = 1u << pin;\n", ""),
    Mutation("the memory of the USB controller is not cleared", USB, "at < 4096; at += 4", "at < 4; at += 4"),
    Mutation("a bus reset without interrupt", USB, "INTERRUPT_BUFFER | INTERRUPT_RESET | INTERRUPT_SUSPEND", "INTERRUPT_BUFFER | INTERRUPT_SUSPEND"),
    Mutation("SETUP is not acknowledged", USB, "        REGISTER(USB_SIE_STATUS) = STATUS_SETUP;\n", ""),
    Mutation("both bulk endpoints have one buffer", USB, "#define OUT_OFFSET 0x1c0u", "#define OUT_OFFSET 0x180u"),
    Mutation("buffers are acknowledged that nobody looked at", USB, "    REGISTER(USB_BUFF_STATUS) = done;", "    REGISTER(USB_BUFF_STATUS) = 0xffffffffu;"),
    Mutation("the address counts before the status stage", CONTROL, "        new_address = (uint8_t)setup.value; /*", "        REGISTER(USB_ADDR_ENDP) = setup.value; /*"),
    Mutation("more is sent than was asked for", CONTROL, "count < setup.count ? count : setup.count", "count"),
    Mutation("only OUT of endpoint 0 stalls", CONTROL, "    REGISTER(BUFFER_CONTROL(0, false)) = STALL;\n", ""),
    Mutation("the pad of GPIO15 is not given back", f"{BOARD}/usb_join.c", "    REGISTER(PADS_BANK0(DATA_PLUS)) = pad;\n", ""),
)  # fmt: skip

FURTHER = (
    Mutation("the crystal's delay is set once it runs", CLOCK, "        REGISTER(XOSC_STARTUP) = CRYSTAL_DELAY;\n        SET_BITS(XOSC_CTRL) = 0xfabu << 12;    /* enable */\n", "        SET_BITS(XOSC_CTRL) = 0xfabu << 12;\n        REGISTER(XOSC_STARTUP) = CRYSTAL_DELAY;\n"),
    Mutation("the crystal is not awaited", CLOCK, "        wait_for(XOSC_STATUS, 1u << 31);\n", ""),
    Mutation("the time is read in two halves", CLOCK, "while (high != REGISTER(TIMER_TIMERAWH));", "while (0);"),
    Mutation("the end of a conversion is not awaited", f"{SHARED}/thermometers.c", "    while (!(REGISTER(ADC_CS) & 1u << 8))\n        ;\n", ""),
    Mutation("the trigger waits for USB", CLOCK, "prioritize(IRQ_IO_BANK0, 0x40u);", "prioritize(IRQ_IO_BANK0, 0xc0u);"),
    Mutation("the tick is not enabled", f"{BOARD}/registers.h", "1u << 9 | 12;", "12;"),
    Mutation("the reason of the start is lost", f"{SHARED}/watchdog.c", "    REGISTER(WATCHDOG_SCRATCH1) = REGISTER(WATCHDOG_SCRATCH0);\n", ""),
    Mutation("no fault vector once the image runs", f"{SHARED}/start.c", "    [3] = fault,\n", ""),
    Mutation("boot2: the vectors stay those of the boot ROM", f"{BOARD}/boot2.S", "@ VTOR\n    str r0, [r1]\n", "@ VTOR\n"),
    Mutation("the DMA writes to address after address", LIGHT, "1u << 0 | 2u << 2 | 1u << 4", "1u << 0 | 2u << 2 | 1u << 4 | 1u << 5"),
    Mutation("words are not pulled by themselves", LIGHT, "1u << 17 | (bits & 31u)", "(bits & 31u)"),
    Mutation("the FIFO's room is not awaited at a fault", LIGHT, "        while (REGISTER(PIO0_FSTAT) & 1u << 16)\n            ;\n", ""),
    Mutation("the trigger listens to a level", PINS, "(falling ? 4u : 8u)", "(falling ? 1u : 2u)"),
    Mutation("the trigger is pulled down", f"{SHARED}/common_registers.h", "#define PAD_PULLED_UP 0x4au", "#define PAD_PULLED_UP 0x46u"),
    Mutation("outputs begin at the other level", PINS, "REGISTER(high ? SIO_OUT_SET : SIO_OUT_CLEAR) = 1u << pin;", "REGISTER(high ? SIO_OUT_CLEAR : SIO_OUT_SET) = 1u << pin;"),
    Mutation("a suspend is not acknowledged", USB, "        REGISTER(USB_SIE_STATUS) = STATUS_SUSPENDED;\n", ""),
    Mutation("the start of a frame is not acknowledged", USB, "    (void)REGISTER(USB_SOF_RD); /* ends the interrupt */\n", ""),
    Mutation("the status stage comes with DATA0", CONTROL, "    control_abort();\n    control_data1 = true;", "    control_abort();\n    control_data1 = false;"),
    Mutation("64 KiB are erased for a sector", f"{SHARED}/flash.c", "PORT_SECTOR_BYTES, SECTOR_ERASE);", "PORT_SECTOR_BYTES, 0xd8u);"),
    Mutation("the flash's clock has an odd divider", f"{BOARD}/rom.c", "REGISTER(SSI_BAUDR) = 6;", "REGISTER(SSI_BAUDR) = 1;"),
)  # fmt: skip
