"""The protocol of the light ring: the one definition, from which the C header and the document are generated.

A packet is ``type u8, sequence u8, payload, CRC-16/CCITT-FALSE u16`` (little endian), COBS encoded, ended by a zero
byte. A request of type T is answered by type ``T | REPLY`` with the same sequence number; the reply's payload is
``status u8, value u32`` and, where the status is OK, the reply record. A request that is sent again unchanged gets
the reply of its first execution and is not executed twice. Events have types of their own, from EVENT up.

The checksum of the schema travels in HELLO, whose layout never changes, so that any two versions can tell that they
differ.

Host and board have to agree on the major version alone. A minor version adds commands, events, members of enumerations,
and fields with a default at the end of replies and events, never of requests; limits may change. So each side ignores
what it does not know: fields behind those it knows, and events; it refuses a command with UNKNOWN_COMMAND.
"""
# After a change here run `python -m firmware.tools.generate`.

import zlib
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from gellight.base.leds import MOST_LEDS
from gellight.ring.enumerations import ENUMS
from gellight.ring.wire import (
    COLOUR_BYTES,
    LED_COUNT,
    PACKET_BYTES,
    Bytes8,
    Bytes16,
    Colours,
    Record,
    i16,
    i32,
    layout,
    u8,
    u16,
    u32,
    u64,
)

VERSION = (3, 0)  # major: who has another one is refused; minor: messages were added
GROUP_COUNT = 16  # chosen: a group for each of 12 LEDs, and some more
STEP_COUNT = 32  # chosen: twice the groups
REPLY = 0x80  # the highest bit of a type
EVENT = 0x40  # the next bit
TICK_HZ = 1_000_000  # the board counts microseconds
DWELL_MIN_US = 2_000
"""12 LEDs take 660 us on the wire and to latch, 24 of 32 bits 1260, and the longest command holds the board up for less
than the rest"""
DWELL_MAX_US = 60_000_000  # chosen: a minute
CURRENT_CAP_MA = 450
"""the most that a USB port may be asked for, unless the board has its own supply"""
CURRENT_CAP_EXTERNAL_MA = 2_000  # chosen: 24 LEDs of 60 mA take 1440
CHANNEL_USB_UA = 20_000
"""of one colour of a WS2812B, the most of the usual LEDs: on USB less may not be assumed"""
CHANNEL_EXTERNAL_UA = 12_000
"""no LED of the 5050 package draws less"""
CHANNEL_LEAST_UA = 5_000
"""of a WS2812C-2020: no LED draws less; below the two above only with SET_SUPPLY"""
HOUSING_MA = 600
"""mean of the last minutes above which the LEDs are dimmed: 3 W, which warm a printed housing by some 25 degrees"""
TRIM_MAX = 42_949_673
"""one per cent"""
RESET_MAGIC = 0x52534554  # "RSET" in ASCII, and below "BOOT" and "SUPP": a broken packet asks for none of them
BOOTLOADER_MAGIC = 0x424F4F54  # "BOOT"
SUPPLY_MAGIC = 0x53555050  # "SUPP"
NO_STEP = 0xFF  # the largest of 8 bits: no number of a step
NO_PIN = 0xFF  # as NO_STEP; chips have fewer pins
ACTIVE_LOW = 0x80
"""added to the number of a pin that is driven low to switch on"""
FULL_SCALE = 0xFFFF  # of 16 bits: colours as they were sent
NO_TEMPERATURE = 0x7FFF  # the largest of 16 bits: 3276.7 degrees
HOTTEST_C = 60
"""of a board that was not configured otherwise"""
COOLER_C = 5
"""the LEDs get brighter again when chip and ring are so much cooler than their limits"""
RING_HOTTEST_C = 60
"""of the ring's NTC: above it printed parts soften; nothing changes it"""
DIMMINGS = 3
"""halvings at most: to an eighth"""
DIMMING_US = 10_000_000
"""from one dimming to the next"""
SAVES_AT_ONCE = 8
"""of the configuration after power came; one after another start"""
SAVE_EVERY_US = 60_000_000
"""and then one so often: flash wears out"""
SUPPLY_US = 20_000
"""from the moment at which the load switch of the LEDs closes to their first light"""

CONSTANTS = {
    "LED_COUNT": LED_COUNT,
    "MOST_LEDS": MOST_LEDS,
    "COLOUR_BYTES": COLOUR_BYTES,
    "GROUP_COUNT": GROUP_COUNT,
    "STEP_COUNT": STEP_COUNT,
    "PACKET_BYTES": PACKET_BYTES,
    "REPLY": REPLY,
    "EVENT": EVENT,
    "TICK_HZ": TICK_HZ,
    "DWELL_MIN_US": DWELL_MIN_US,
    "DWELL_MAX_US": DWELL_MAX_US,
    "CURRENT_CAP_MA": CURRENT_CAP_MA,
    "CURRENT_CAP_EXTERNAL_MA": CURRENT_CAP_EXTERNAL_MA,
    "CHANNEL_USB_UA": CHANNEL_USB_UA,
    "CHANNEL_EXTERNAL_UA": CHANNEL_EXTERNAL_UA,
    "CHANNEL_LEAST_UA": CHANNEL_LEAST_UA,
    "HOUSING_MA": HOUSING_MA,
    "TRIM_MAX": TRIM_MAX,
    "RESET_MAGIC": RESET_MAGIC,
    "BOOTLOADER_MAGIC": BOOTLOADER_MAGIC,
    "SUPPLY_MAGIC": SUPPLY_MAGIC,
    "NO_STEP": NO_STEP,
    "NO_PIN": NO_PIN,
    "ACTIVE_LOW": ACTIVE_LOW,
    "FULL_SCALE": FULL_SCALE,
    "NO_TEMPERATURE": NO_TEMPERATURE,
    "HOTTEST_C": HOTTEST_C,
    "COOLER_C": COOLER_C,
    "RING_HOTTEST_C": RING_HOTTEST_C,
    "DIMMINGS": DIMMINGS,
    "DIMMING_US": DIMMING_US,
    "SAVES_AT_ONCE": SAVES_AT_ONCE,
    "SAVE_EVERY_US": SAVE_EVERY_US,
    "SUPPLY_US": SUPPLY_US,
}


@dataclass(frozen=True)
class Empty(Record):
    """Nothing."""


@dataclass(frozen=True)
class HelloReply(Record):
    """Who answers. This layout never changes."""

    protocol_major: u8
    protocol_minor: u8
    schema_crc: Annotated[u32, "CRC-32 of the schema the firmware was generated from"]
    firmware_major: u8
    firmware_minor: u8
    firmware_patch: u8
    board: Annotated[u8, "enum board_kind"]
    reset_reason: Annotated[u8, "enum reset_reason"]
    unique_id: Annotated[Bytes8, "of the flash chip"]
    capabilities: Annotated[u32, "bits of enum capability"]
    led_count: u8
    group_count: u8
    step_count: u8
    packet_bytes: u8
    tick_hz: Annotated[u32, "of every time on the wire"]
    image_crc: Annotated[u32, "CRC-32 of the running image, 0 where there is none"]


@dataclass(frozen=True)
class ClockRequest(Record):
    """A time of the host, to be sent back."""

    host_us: u64


@dataclass(frozen=True)
class ClockReply(Record):
    """The times from which the host learns offset and drift of the board's clock."""

    host_us: u64
    received_us: Annotated[u64, "board clock when the packet was complete"]
    sent_us: Annotated[u64, "board clock when the reply was queued"]


@dataclass(frozen=True)
class SetLeds(Record):
    """A light for all LEDs at once; refused while a sequence runs."""

    colours: Annotated[Colours, "red, green, blue of LED 0, of LED 1, ...; 3 bytes for each of led_count LEDs"]


@dataclass(frozen=True)
class LightReply(Record):
    """What will be lit."""

    light_id: Annotated[u32, "the LIGHT event of this light carries it"]
    current_ma: Annotated[u16, "by the current model, after scaling"]
    scale: Annotated[u16, "0xFFFF: as asked; less: every colour is multiplied by scale / 0xFFFF, because of heat"]


@dataclass(frozen=True)
class SetGroup(Record):
    """One of the 16 light groups, staged until COMMIT."""

    group: u8
    colours: Colours


@dataclass(frozen=True)
class GroupReply(Record):
    """What the group draws."""

    current_ma: Annotated[u16, "after scaling"]
    scale: Annotated[u16, "as in LightReply"]


@dataclass(frozen=True)
class SetStep(Record):
    """One of the 32 steps of the sequence, staged until COMMIT."""

    step: u8
    group: u8
    repeat: Annotated[u16, "how often the step is shown, at least 1"]
    dwell_us: Annotated[u32, "how long it is lit; 0 (EXT): until the next step"]
    blank_us: Annotated[u32, "how long it is dark after that (FREE); 0: not at all"]


@dataclass(frozen=True)
class Commit(Record):
    """Make the staged groups and steps the sequence, at once or, while one runs, when its pass ends."""

    table_crc: Annotated[u32, "CRC-32 over all 16 groups, 3 bytes an LED, then the first step_count SET_STEP records"]
    loops: Annotated[u16, "passes through the steps, 0: endless"]
    step_count: Annotated[u8, "1 to 32"]


@dataclass(frozen=True)
class SetSync(Record):
    """What moves the sequence on."""

    mode: Annotated[u8, "enum sync_mode"]
    edge: Annotated[u8, "enum edge"]
    divider: Annotated[u16, "every how many edges of the trigger, at least 1"]
    delay_us: Annotated[u32, "from that edge to the first bit of the light"]
    timeout_us: Annotated[u32, "without an edge for so long: dark and counted; 0: never"]


@dataclass(frozen=True)
class Trim(Record):
    """Move a FREE sequence against a camera; takes effect at the next step."""

    phase_us: Annotated[i32, "added once"]
    period: Annotated[i32, "added to every duration, in 2^-32 of it; at most TRIM_MAX either way"]


@dataclass(frozen=True)
class StatusReply(Record):
    """What the board is doing."""

    time_us: u64
    light_id: Annotated[u32, "of the last light latched"]
    config_saves: Annotated[u32, "how often the configuration was written in its life"]
    current_ma: Annotated[u16, "of the light that is on"]
    limit_ma: u16
    temperature: Annotated[i16, "of the chip, in 0.1 degrees Celsius, good to 10 degrees; NO_TEMPERATURE: no sensor"]
    repetition: u16
    loop: u16
    events_dropped: u16
    state: Annotated[u8, "enum state"]
    dark: Annotated[u8, "enum dark"]
    mode: Annotated[u8, "enum sync_mode"]
    step: Annotated[u8, "0xFF: no sequence"]
    dimmed: Annotated[u8, "how often every colour is halved because chip, ring or housing is hot, 0 to DIMMINGS"] = 0
    mean_ma: Annotated[u16, "of the last seven minutes; above HOUSING_MA the LEDs are dimmed"] = 0
    ring_temperature: Annotated[
        i16, "of the ring's NTC, in 0.1 degrees Celsius; NO_TEMPERATURE: there is none, or it is broken or short"
    ] = NO_TEMPERATURE


@dataclass(frozen=True)
class CountersReply(Record):
    """What went wrong since the start, and how often."""

    packets: Annotated[u32, "received and well formed"]
    bad_crc: u32
    bad_framing: u32
    oversize: u32
    bad_length: u32
    unknown_command: u32
    refused: Annotated[u32, "any other status than OK"]
    repeated: Annotated[u32, "requests answered from the cache"]
    replies_dropped: u32
    events_dropped: u32
    lights: Annotated[u32, "latched"]
    late_steps: u32
    triggers: Annotated[u32, "edges that should light a step"]
    triggers_missed: Annotated[u32, "of these, while no step was ready"]
    trigger_timeouts: u32
    dark_faults: Annotated[u32, "times the LEDs were darkened for safety"]
    flash_retries: u32


@dataclass(frozen=True)
class Configuration(Record):
    """What the board remembers without power. What lets its LEDs draw more counts from the next start on."""

    host_timeout_ms: Annotated[u16, "silence after which the LEDs go dark, 100 to 60000"]
    limit_ma: u16
    quiescent_ua: Annotated[u16, "of a dark LED"]
    channel_ua: Annotated[u16, "of one colour of one LED at 255: CHANNEL_USB_UA or more; less as SET_SUPPLY says"]
    latch_us: Annotated[u16, "low time after which the LEDs take their data, 50 to 500"]
    unused: Annotated[u8, "taken as it comes: what older firmware saved has something here"]
    external_supply: Annotated[u8, "1: the LEDs have their own supply and limit_ma may exceed 450; set by SET_SUPPLY"]
    name: Annotated[Bytes16, "of the sensor, UTF-8, padded with zeros"]
    bundle: Annotated[Bytes8, "identity of the calibration bundle of the sensor; all 0x00 or all 0xFF: none"] = bytes(8)
    data_pin: Annotated[u8, "GPIO of the LEDs' data, 0 to 29; this and what follows counts from the next start on"] = 2
    trigger_pin: Annotated[u8, "GPIO of the camera's strobe"] = 3
    led_count: Annotated[u8, "1 to 24"] = LED_COUNT
    colour_order: Annotated[u8, "enum colour_order"] = 0
    status_pin: Annotated[u8, "GPIO of a status LED, plus ACTIVE_LOW where it lights when low; NO_PIN: none"] = 25
    output_pin: Annotated[u8, "GPIO that pulses high for 100 us in each light, for a camera; NO_PIN: none"] = 0xFF
    output_at: Annotated[u8, "enum output_at"] = 0
    switch_pin: Annotated[u8, "GPIO of a load switch, closed while LEDs are lit, plus ACTIVE_LOW; NO_PIN: none"] = 0xFF
    hottest_c: Annotated[u8, "degrees Celsius of the chip above which the LEDs are dimmed, 40 to 85"] = HOTTEST_C


@dataclass(frozen=True)
class Magic(Record):
    """A number that says that this is meant."""

    magic: u32


@dataclass(frozen=True)
class SetSupply(Record):
    """What no command can measure, and no program may get wrong: what feeds the LEDs, and what they draw."""

    magic: Annotated[u32, "SUPPLY_MAGIC"]
    channel_ua: Annotated[u16, "as in the configuration, CHANNEL_LEAST_UA or more"]
    external_supply: Annotated[u8, "as in the configuration"]


@dataclass(frozen=True)
class SelfTestReply(Record):
    """What was tested and what failed."""

    image_crc: u32
    stack_free: Annotated[u32, "bytes of the stack never used"]
    tested: Annotated[u16, "bits of enum check"]
    failed: Annotated[u16, "bits of enum check"]


@dataclass(frozen=True)
class LightEvent(Record):
    """A light was latched by the LEDs."""

    first_bit_us: Annotated[u64, "board clock when its transfer began"]
    latched_us: Annotated[u64, "board clock when the last LED had taken it; it shows within one PWM period of the LED"]
    light_id: u32
    repetition: u16
    loop: u16
    events_dropped: Annotated[u16, "events lost before this one, since the start"]
    step: Annotated[u8, "0xFF: not of a sequence"]
    group: Annotated[u8, "0xFF: dark or not of a sequence"]


@dataclass(frozen=True)
class DarkEvent(Record):
    """The board made its LEDs dark by itself."""

    time_us: u64
    events_dropped: u16
    dark: Annotated[u8, "enum dark"]


@dataclass(frozen=True)
class DimmedEvent(Record):
    """The board dims its LEDs by another amount than before, because chip, ring or housing has become hot or cool."""

    time_us: u64
    temperature: Annotated[i16, "as in StatusReply"]
    events_dropped: u16
    dimmed: Annotated[u8, "as in StatusReply; 0: not any more"]
    mean_ma: Annotated[u16, "as in StatusReply"] = 0
    ring_temperature: Annotated[i16, "as in StatusReply"] = NO_TEMPERATURE


class Exchange(NamedTuple):
    """A request, its reply, and what it is for."""

    code: int
    request: type[Record]
    reply: type[Record]
    meaning: str


COMMANDS: dict[str, Exchange] = {
    "HELLO": Exchange(0x01, Empty, HelloReply, "Who are you? Always executed, never answered from the cache."),
    "CLOCK": Exchange(0x02, ClockRequest, ClockReply, "What is the time? Also what keeps the LEDs lit."),
    "SET_LEDS": Exchange(0x03, SetLeds, LightReply, "Light the LEDs."),
    "SET_GROUP": Exchange(0x04, SetGroup, GroupReply, "Stage a light group."),
    "SET_STEP": Exchange(0x05, SetStep, Empty, "Stage a step."),
    "COMMIT": Exchange(0x06, Commit, Empty, "Take over what is staged."),
    "SET_SYNC": Exchange(0x07, SetSync, Empty, "Choose what moves the sequence on; refused while one runs."),
    "TRIM": Exchange(0x08, Trim, Empty, "Shift and stretch a running FREE sequence."),
    "START": Exchange(0x09, Empty, Empty, "Begin the committed sequence."),
    "STOP": Exchange(0x0B, Empty, Empty, "End the sequence; what is lit stays lit."),
    "BLANK": Exchange(0x0C, Empty, Empty, "End the sequence and make the LEDs dark."),
    "STATUS": Exchange(0x0E, Empty, StatusReply, "What are you doing?"),
    "COUNTERS": Exchange(0x0F, Empty, CountersReply, "What went wrong?"),
    "GET_CONFIG": Exchange(0x11, Empty, Configuration, "Read the configuration."),
    "SET_CONFIG": Exchange(0x12, Configuration, Empty, "Change it, not yet saved; the LEDs have to be dark."),
    "SAVE_CONFIG": Exchange(0x13, Empty, Empty, "Write it to flash, if it differs; the LEDs have to be dark."),
    "RESET": Exchange(0x15, Magic, Empty, "Start anew."),
    "BOOTLOADER": Exchange(0x16, Magic, Empty, "Start the boot loader of the chip."),
    "SELFTEST": Exchange(0x17, Empty, SelfTestReply, "Test yourself; the LEDs have to be dark."),
    "SET_SUPPLY": Exchange(0x18, SetSupply, Empty, "Change what feeds the LEDs from the next start on, not yet saved."),
}

EVENTS: dict[str, tuple[int, type[Record]]] = {
    "LIGHT": (0x40, LightEvent),
    "DARK": (0x41, DarkEvent),
    "DIMMED": (0x43, DimmedEvent),
}


def records() -> list[type[Record]]:
    """Return every record once, in the order of the messages."""
    found: dict[type[Record], None] = {}
    for exchange in COMMANDS.values():
        found |= {exchange.request: None, exchange.reply: None}
    found |= {record: None for _, record in EVENTS.values()}
    return [record for record in found if record is not Empty]


def schema() -> str:
    """Return what two sides have to agree on, as text: numbers, names, fields and their types, in order."""
    rows = [f"constant {name} {value}" for name, value in CONSTANTS.items()]
    rows += [f"enum {enum.__name__} " + " ".join(f"{m.name}={m.value}" for m in enum) for enum in ENUMS]
    for record in records():
        rows.append(f"record {record.__name__} " + " ".join(f"{name}:{s.code}" for name, s, _ in layout(record)))
    rows += [f"command {n} {e.code} {e.request.__name__} {e.reply.__name__}" for n, e in COMMANDS.items()]
    rows += [f"event {name} {code} {record.__name__}" for name, (code, record) in EVENTS.items()]
    return "\n".join(rows)


def schema_crc() -> int:
    """Return the CRC-32 of the schema, which HELLO carries."""
    return zlib.crc32(schema().encode())
