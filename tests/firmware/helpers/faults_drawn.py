"""Forty faults of the RP2040's code, drawn by rule and listed before any was tried.

Nobody had taught the emulator for them when they were tried first: 22 were noticed. Since then emulator and examination
were taught what 16 others showed, and the list is not kept apart any more. Two turned out to change nothing: the ROM
ends the override of the flash's select line too (2.8.3.1.3), and an alarm that stays in the timer finds no light.
`python -m tests.benchmarks.planted drawn` plants them. BY_REGISTER goes through the blocks of the data sheet. BY_LINE takes the
code of `boards/rp2` and `boards/rp2040`, file after file by name, at 20 places at even distances: at each the nearest
statement whose fault would break or endanger a real board, and that no other list has.
"""

# ruff: noqa: E501 (a line of C stays one line)

from tests.firmware.helpers.mutations import BOARD, SHARED, Mutation

CLOCK, LIGHT, PINS, USB, CONTROL, THERMOMETERS = (
    f"{SHARED}/{name}.c" for name in ("clock", "light", "pins", "usb", "usb_control", "thermometers")
)
REGISTERS, ROM = f"{BOARD}/registers.h", f"{BOARD}/rom.c"

BY_REGISTER = (
    Mutation("CLOCKS: the converter at 120 MHz", CLOCK, "REGISTER(CLK_ADC_CTRL) = 1u << 11;", "REGISTER(CLK_ADC_CTRL) = 1u << 11 | 1u << 5;", "heat"),
    Mutation("PLL: its oscillator has no power", CLOCK, "= 1u << 0 | 1u << 5;", "= 1u << 0;"),
    Mutation("RESETS: the converter stays in reset", CLOCK, "free_blocks(RESET_ADC | RESET_DMA", "free_blocks(RESET_DMA", "heat"),
    Mutation("RESETS: the DMA stays in reset", CLOCK, "free_blocks(RESET_ADC | RESET_DMA", "free_blocks(RESET_ADC"),
    Mutation("PADS: the input of the NTC is pulled down", f"{SHARED}/common_registers.h", "#define PAD_ANALOG_PULLED_UP 0x88u", "#define PAD_ANALOG_PULLED_UP 0x84u", "heat"),
    Mutation("IO: the pin of the trigger does not count as in use", PINS, "    REGISTER(IO_BANK0_CTRL(trigger_pin)) = FUNCTION_SIO;\n", "", "trigger"),
    Mutation("IO: edges of the trigger go to the other core", REGISTERS, "0x40014100u", "0x40014130u", "trigger"),
    Mutation("PIO: a one is high for a microsecond", LIGHT, "{0x6621, 0x1323, 0x1300, 0xa342}", "{0x6621, 0x1323, 0x1700, 0xa342}"),
    Mutation("PIO: the FIFO of another state machine is asked", LIGHT, "REGISTER(PIO0_FSTAT) & 1u << 24;", "REGISTER(PIO0_FSTAT) & 1u << 25;", "sequence"),
    Mutation("DMA: a transfer starts when it is prepared", LIGHT, "REGISTER(DMA_AL1_CTRL) = ", "REGISTER(DMA_CTRL_TRIG) = ", "trigger"),
    Mutation("DMA: words that were left do not count", LIGHT, " && !REGISTER(DMA_TRANS_COUNT)", "", "fault"),
    Mutation("USB: a suspend without interrupt", USB, "INTERRUPT_RESET | INTERRUPT_SUSPEND | INTERRUPT_RESUME", "INTERRUPT_RESET | INTERRUPT_RESUME", "suspend"),
    Mutation("USB: a buffer that is at no multiple of 64", USB, "#define OUT_OFFSET 0x1c0u", "#define OUT_OFFSET 0x1d0u"),
    Mutation("USB: a stall is armed for IN alone", CONTROL, "REGISTER(USB_EP_STALL_ARM) = 3;", "REGISTER(USB_EP_STALL_ARM) = 1;", "refusals"),
    Mutation("SSI: the answer of the flash is not awaited", ROM, "    while (!(REGISTER(SSI_SR) & 1u << 3)) /* something came back */\n        ;\n", ""),
    Mutation("IO_QSPI: the select line of the flash stays overridden", ROM, "    REGISTER(IO_QSPI_SS_CTRL) &= ~0x300u;\n", "", "configuration"),
    Mutation("ADC: conversions without end", THERMOMETERS, "channel << 12 | 1u << 2 |", "channel << 12 | 1u << 3 |", "heat"),
    Mutation("TIMER: a pulse that was called off comes all the same", PINS, "    REGISTER(TIMER_ARMED) = 1u << 2;\n", "", "wiring"),
    Mutation("WATCHDOG: the longest time does not fit its 24 bits", f"{SHARED}/watchdog.c", "REGISTER(WATCHDOG_LOAD) = 0xffffffu;", "REGISTER(WATCHDOG_LOAD) = 0x1000000u;"),
    Mutation("NVIC: the interrupt of USB is not held off", USB, "    REGISTER(NVIC_ICER) = 1u << IRQ_USB;\n", "", "flood"),
)  # fmt: skip

BY_LINE = (
    Mutation("the header of the image in another order", f"{SHARED}/board.h", "    uint32_t count;\n    uint32_t crc;\n", "    uint32_t crc;\n    uint32_t count;\n", "configuration"),
    Mutation("the ring of bytes is read as one shorter", f"{SHARED}/byte_ring.h", "ring->bytes[ring->tail % RING_BYTES]", "ring->bytes[ring->tail % (RING_BYTES - 1u)]", "flood"),
    Mutation("bits are set by the alias that toggles", f"{SHARED}/common_registers.h", "#define SET_BITS(address) REGISTER((address) + 0x2000u)", "#define SET_BITS(address) REGISTER((address) + 0x1000u)"),
    Mutation("each record is read from the first page", f"{SHARED}/flash.c", "(FLASH_BASE + CONFIG_OFFSET) + offset, count", "(FLASH_BASE + CONFIG_OFFSET) + 0u * offset, count", "configuration"),
    Mutation("an alarm that fires as it is cancelled stays in the timer", LIGHT, "    REGISTER(TIMER_INTR) = 1u << 0;\n    REGISTER(NVIC_ICPR)", "    REGISTER(NVIC_ICPR)", "sequence"),
    Mutation("the fault handler leaves the last LED", LIGHT, "    for (uint32_t i = 0; i < leds; i++) {\n        while", "    for (uint32_t i = 1; i < leds; i++) {\n        while", "fault"),
    Mutation("1200 baud restarts without the boot loader", f"{SHARED}/main.c", "watches_restart(&controller, true);", "watches_restart(&controller, false);", "reflash"),
    Mutation("the edge of a trigger at GPIO 4 to 7 is not acknowledged", PINS, "BOTH_EDGES << 4u * (trigger_pin % 8u);", "BOTH_EDGES << 4u * (trigger_pin % 4u);", "wiring"),
    Mutation("a carry of the long product is lost", f"{SHARED}/runtime.c", " + (other >> 16) + (middle >> 16);", " + (other >> 16);", "sequence"),
    Mutation("an input with nothing at it is measured without the pull-up", THERMOMETERS, "    pull(!pulled || now >= THERMISTOR_OPEN);", "    pull(!pulled);", "heat"),
    Mutation("a packet of 64 bytes counts as empty", USB, "REGISTER(BUFFER_CONTROL(2, true)) & COUNT;", "REGISTER(BUFFER_CONTROL(2, true)) & 63u;", "flood"),
    Mutation("a halt outlives the choice of a configuration", USB, "    halted = in_count = 0;", "    in_count = 0;", "bus"),
    Mutation("an endpoint that the host halted passes for a hang", USB, "in_busy && !data_halted(BULK_IN) &&", "in_busy &&", "bus"),
    Mutation("endpoint 0 repeats DATA1", CONTROL, "    control_data1 = !control_data1;\n", ""),
    Mutation("addresses from 64 on are refused", CONTROL, "setup.value <= LAST_ADDRESS", "setup.value < 64u", "bus"),
    Mutation("the address stays through a reset of the bus", CONTROL, "    REGISTER(USB_ADDR_ENDP) = 0;\n", "", "bus"),
    Mutation("the endpoint of notifications by another number", f"{SHARED}/usb_wire.h", "#define NOTIFY_IN 0x81u", "#define NOTIFY_IN 0x83u", "bus"),
    Mutation("boot2: the command is written beside its register", f"{BOARD}/boot2.S", "=0x180000f4", "=0x180000f0"),
    Mutation("the watchdog takes twice its time", REGISTERS, "#define WATCHDOG_COUNTS_A_US 2u", "#define WATCHDOG_COUNTS_A_US 4u", "watchdog"),
    Mutation("GPIO15 floats while it stands for D+", f"{BOARD}/usb_join.c", "= pad | PAD_BUS_KEEP;", "= pad;", "hub"),
)  # fmt: skip

DRAWN = BY_REGISTER + BY_LINE
