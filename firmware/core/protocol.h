/* Generated from host/gellight/ring/protocol.py by `python firmware/generate.py`; do not edit. */

#ifndef GELLIGHT_PROTOCOL_H
#define GELLIGHT_PROTOCOL_H

#include <stdint.h>

#define PROTOCOL_MAJOR 3u
#define PROTOCOL_MINOR 0u
#define SCHEMA_CRC 0x9f73514fu
#define LED_COUNT 12u
#define MOST_LEDS 24u
#define COLOUR_BYTES 72u
#define GROUP_COUNT 16u
#define STEP_COUNT 32u
#define PACKET_BYTES 128u
#define REPLY 128u
#define EVENT 64u
#define TICK_HZ 1000000u
#define DWELL_MIN_US 2000u
#define DWELL_MAX_US 60000000u
#define CURRENT_CAP_MA 450u
#define CURRENT_CAP_EXTERNAL_MA 2000u
#define CHANNEL_USB_UA 20000u
#define CHANNEL_EXTERNAL_UA 12000u
#define CHANNEL_LEAST_UA 5000u
#define HOUSING_MA 600u
#define TRIM_MAX 42949673u
#define RESET_MAGIC 0x52534554u
#define BOOTLOADER_MAGIC 0x424f4f54u
#define SUPPLY_MAGIC 0x53555050u
#define NO_STEP 255u
#define NO_PIN 255u
#define ACTIVE_LOW 128u
#define FULL_SCALE 65535u
#define NO_TEMPERATURE 32767u
#define HOTTEST_C 60u
#define COOLER_C 5u
#define RING_HOTTEST_C 60u
#define DIMMINGS 3u
#define DIMMING_US 10000000u
#define SAVES_AT_ONCE 8u
#define SAVE_EVERY_US 60000000u
#define SUPPLY_US 20000u

/* How a request ended; `value` of the reply is what was refused. */
enum status {
    STATUS_OK = 0,
    STATUS_UNKNOWN_COMMAND = 1,
    STATUS_BAD_LENGTH = 2,
    STATUS_OUT_OF_RANGE = 3,
    STATUS_OVER_CURRENT = 4,
    STATUS_BUSY = 5,
    STATUS_NOT_RUNNING = 6,
    STATUS_WRONG_MODE = 7,
    STATUS_CHECKSUM = 8,
    STATUS_BAD_MAGIC = 9,
    STATUS_FLASH_FAILED = 10,
    STATUS_SAVED_TOO_OFTEN = 11,
};

/* What moves the sequence on: the board's clock, or the trigger pin. */
enum sync_mode {
    SYNC_MODE_FREE = 0,
    SYNC_MODE_EXT = 1,
};

/* Which edge of the trigger pin counts. */
enum edge {
    EDGE_RISING = 0,
    EDGE_FALLING = 1,
};

/* In which order an LED takes its colours. RGBW: SK6812 RGBW, green first, whose white stays dark. */
enum colour_order {
    COLOUR_ORDER_GRB = 0,
    COLOUR_ORDER_RGB = 1,
    COLOUR_ORDER_RGBW = 2,
};

/* When in a light the trigger output pulses: once it is latched, or in the middle of its dwell. */
enum output_at {
    OUTPUT_AT_START = 0,
    OUTPUT_AT_MIDDLE = 1,
};

/* What the light ring is doing. */
enum state {
    STATE_STILL = 0,
    STATE_RUNNING = 1,
};

/* Why the LEDs are dark. */
enum dark {
    DARK_NOT_DARK = 0,
    DARK_BOOT = 1,
    DARK_COMMAND = 2,
    DARK_SEQUENCE_ENDED = 3,
    DARK_HOST_SILENT = 4,
    DARK_PORT_CLOSED = 5,
    DARK_SUSPENDED = 6,
    DARK_TRIGGER_MISSED = 7,
    DARK_FAULT = 8,
};

/* Why the board started. */
enum reset_reason {
    RESET_REASON_POWER = 0,
    RESET_REASON_COMMAND = 1,
    RESET_REASON_WATCHDOG = 2,
    RESET_REASON_FAULT = 3,
};

/* What the firmware runs on. */
enum board_kind {
    BOARD_KIND_HOST = 0,
    BOARD_KIND_RP2040 = 1,
    BOARD_KIND_RP2350 = 2,
};

/* What a board can do besides lighting its LEDs. */
enum capability {
    CAPABILITY_TRIGGER = 1,
    CAPABILITY_FLASH = 2,
    CAPABILITY_BOOTLOADER = 4,
    CAPABILITY_TEMPERATURE = 16,
};

/* The parts of the self-test. */
enum check {
    CHECK_IMAGE = 1,
    CHECK_STORE = 2,
    CHECK_LIGHT_PATH = 4,
    CHECK_STACK = 8,
};

enum command {
    COMMAND_HELLO = 0x01,
    COMMAND_CLOCK = 0x02,
    COMMAND_SET_LEDS = 0x03,
    COMMAND_SET_GROUP = 0x04,
    COMMAND_SET_STEP = 0x05,
    COMMAND_COMMIT = 0x06,
    COMMAND_SET_SYNC = 0x07,
    COMMAND_TRIM = 0x08,
    COMMAND_START = 0x09,
    COMMAND_STOP = 0x0b,
    COMMAND_BLANK = 0x0c,
    COMMAND_STATUS = 0x0e,
    COMMAND_COUNTERS = 0x0f,
    COMMAND_GET_CONFIG = 0x11,
    COMMAND_SET_CONFIG = 0x12,
    COMMAND_SAVE_CONFIG = 0x13,
    COMMAND_RESET = 0x15,
    COMMAND_BOOTLOADER = 0x16,
    COMMAND_SELFTEST = 0x17,
    COMMAND_SET_SUPPLY = 0x18,
};

enum event {
    EVENT_LIGHT = 0x40,
    EVENT_DARK = 0x41,
    EVENT_DIMMED = 0x43,
};

/* Records lie in packets as they are: little endian, without gaps, at any address. */
#define RECORD __attribute__((packed, may_alias))

/* Who answers. This layout never changes. */
struct RECORD hello_reply {
    uint8_t protocol_major;
    uint8_t protocol_minor;
    uint32_t schema_crc; /* CRC-32 of the schema the firmware was generated from */
    uint8_t firmware_major;
    uint8_t firmware_minor;
    uint8_t firmware_patch;
    uint8_t board; /* enum board_kind */
    uint8_t reset_reason; /* enum reset_reason */
    uint8_t unique_id[8]; /* of the flash chip */
    uint32_t capabilities; /* bits of enum capability */
    uint8_t led_count;
    uint8_t group_count;
    uint8_t step_count;
    uint8_t packet_bytes;
    uint32_t tick_hz; /* of every time on the wire */
    uint32_t image_crc; /* CRC-32 of the running image, 0 where there is none */
};
_Static_assert(sizeof(struct hello_reply) == 35, "hello_reply");

/* A time of the host, to be sent back. */
struct RECORD clock_request {
    uint64_t host_us;
};
_Static_assert(sizeof(struct clock_request) == 8, "clock_request");

/* The times from which the host learns offset and drift of the board's clock. */
struct RECORD clock_reply {
    uint64_t host_us;
    uint64_t received_us; /* board clock when the packet was complete */
    uint64_t sent_us; /* board clock when the reply was queued */
};
_Static_assert(sizeof(struct clock_reply) == 24, "clock_reply");

/* A light for all LEDs at once; refused while a sequence runs. */
struct RECORD set_leds {
    uint8_t colours[72]; /* red, green, blue of LED 0, of LED 1, ...; 3 bytes for each of led_count LEDs */
};
_Static_assert(sizeof(struct set_leds) == 72, "set_leds");

/* What will be lit. */
struct RECORD light_reply {
    uint32_t light_id; /* the LIGHT event of this light carries it */
    uint16_t current_ma; /* by the current model, after scaling */
    uint16_t scale; /* 0xFFFF: as asked; less: every colour is multiplied by scale / 0xFFFF, because of heat */
};
_Static_assert(sizeof(struct light_reply) == 8, "light_reply");

/* One of the 16 light groups, staged until COMMIT. */
struct RECORD set_group {
    uint8_t group;
    uint8_t colours[72];
};
_Static_assert(sizeof(struct set_group) == 73, "set_group");

/* What the group draws. */
struct RECORD group_reply {
    uint16_t current_ma; /* after scaling */
    uint16_t scale; /* as in LightReply */
};
_Static_assert(sizeof(struct group_reply) == 4, "group_reply");

/* One of the 32 steps of the sequence, staged until COMMIT. */
struct RECORD set_step {
    uint8_t step;
    uint8_t group;
    uint16_t repeat; /* how often the step is shown, at least 1 */
    uint32_t dwell_us; /* how long it is lit; 0 (EXT): until the next step */
    uint32_t blank_us; /* how long it is dark after that (FREE); 0: not at all */
};
_Static_assert(sizeof(struct set_step) == 12, "set_step");

/* Make the staged groups and steps the sequence, at once or, while one runs, when its pass ends. */
struct RECORD commit {
    uint32_t table_crc; /* CRC-32 over all 16 groups, 3 bytes an LED, then the first step_count SET_STEP records */
    uint16_t loops; /* passes through the steps, 0: endless */
    uint8_t step_count; /* 1 to 32 */
};
_Static_assert(sizeof(struct commit) == 7, "commit");

/* What moves the sequence on. */
struct RECORD set_sync {
    uint8_t mode; /* enum sync_mode */
    uint8_t edge; /* enum edge */
    uint16_t divider; /* every how many edges of the trigger, at least 1 */
    uint32_t delay_us; /* from that edge to the first bit of the light */
    uint32_t timeout_us; /* without an edge for so long: dark and counted; 0: never */
};
_Static_assert(sizeof(struct set_sync) == 12, "set_sync");

/* Move a FREE sequence against a camera; takes effect at the next step. */
struct RECORD trim {
    int32_t phase_us; /* added once */
    int32_t period; /* added to every duration, in 2^-32 of it; at most TRIM_MAX either way */
};
_Static_assert(sizeof(struct trim) == 8, "trim");

/* What the board is doing. */
struct RECORD status_reply {
    uint64_t time_us;
    uint32_t light_id; /* of the last light latched */
    uint32_t config_saves; /* how often the configuration was written in its life */
    uint16_t current_ma; /* of the light that is on */
    uint16_t limit_ma;
    int16_t temperature; /* of the chip, in 0.1 degrees Celsius, good to 10 degrees; NO_TEMPERATURE: no sensor */
    uint16_t repetition;
    uint16_t loop;
    uint16_t events_dropped;
    uint8_t state; /* enum state */
    uint8_t dark; /* enum dark */
    uint8_t mode; /* enum sync_mode */
    uint8_t step; /* 0xFF: no sequence */
    uint8_t dimmed; /* how often every colour is halved because chip, ring or housing is hot, 0 to DIMMINGS */
    uint16_t mean_ma; /* of the last seven minutes; above HOUSING_MA the LEDs are dimmed */
    int16_t ring_temperature; /* of the ring's NTC, in 0.1 degrees Celsius; NO_TEMPERATURE: there is none, or it is broken or short */
};
_Static_assert(sizeof(struct status_reply) == 37, "status_reply");

/* What went wrong since the start, and how often. */
struct RECORD counters_reply {
    uint32_t packets; /* received and well formed */
    uint32_t bad_crc;
    uint32_t bad_framing;
    uint32_t oversize;
    uint32_t bad_length;
    uint32_t unknown_command;
    uint32_t refused; /* any other status than OK */
    uint32_t repeated; /* requests answered from the cache */
    uint32_t replies_dropped;
    uint32_t events_dropped;
    uint32_t lights; /* latched */
    uint32_t late_steps;
    uint32_t triggers; /* edges that should light a step */
    uint32_t triggers_missed; /* of these, while no step was ready */
    uint32_t trigger_timeouts;
    uint32_t dark_faults; /* times the LEDs were darkened for safety */
    uint32_t flash_retries;
};
_Static_assert(sizeof(struct counters_reply) == 68, "counters_reply");

/* What the board remembers without power. What lets its LEDs draw more counts from the next start on. */
struct RECORD configuration {
    uint16_t host_timeout_ms; /* silence after which the LEDs go dark, 100 to 60000 */
    uint16_t limit_ma;
    uint16_t quiescent_ua; /* of a dark LED */
    uint16_t channel_ua; /* of one colour of one LED at 255: CHANNEL_USB_UA or more; less as SET_SUPPLY says */
    uint16_t latch_us; /* low time after which the LEDs take their data, 50 to 500 */
    uint8_t unused; /* taken as it comes: what older firmware saved has something here */
    uint8_t external_supply; /* 1: the LEDs have their own supply and limit_ma may exceed 450; set by SET_SUPPLY */
    uint8_t name[16]; /* of the sensor, UTF-8, padded with zeros */
    uint8_t bundle[8]; /* identity of the calibration bundle of the sensor; all 0x00 or all 0xFF: none */
    uint8_t data_pin; /* GPIO of the LEDs' data, 0 to 29; this and what follows counts from the next start on */
    uint8_t trigger_pin; /* GPIO of the camera's strobe */
    uint8_t led_count; /* 1 to 24 */
    uint8_t colour_order; /* enum colour_order */
    uint8_t status_pin; /* GPIO of a status LED, plus ACTIVE_LOW where it lights when low; NO_PIN: none */
    uint8_t output_pin; /* GPIO that pulses high for 100 us in each light, for a camera; NO_PIN: none */
    uint8_t output_at; /* enum output_at */
    uint8_t switch_pin; /* GPIO of a load switch, closed while LEDs are lit, plus ACTIVE_LOW; NO_PIN: none */
    uint8_t hottest_c; /* degrees Celsius of the chip above which the LEDs are dimmed, 40 to 85 */
};
_Static_assert(sizeof(struct configuration) == 45, "configuration");

/* A number that says that this is meant. */
struct RECORD magic {
    uint32_t magic;
};
_Static_assert(sizeof(struct magic) == 4, "magic");

/* What was tested and what failed. */
struct RECORD self_test_reply {
    uint32_t image_crc;
    uint32_t stack_free; /* bytes of the stack never used */
    uint16_t tested; /* bits of enum check */
    uint16_t failed; /* bits of enum check */
};
_Static_assert(sizeof(struct self_test_reply) == 12, "self_test_reply");

/* What no command can measure, and no program may get wrong: what feeds the LEDs, and what they draw. */
struct RECORD set_supply {
    uint32_t magic; /* SUPPLY_MAGIC */
    uint16_t channel_ua; /* as in the configuration, CHANNEL_LEAST_UA or more */
    uint8_t external_supply; /* as in the configuration */
};
_Static_assert(sizeof(struct set_supply) == 7, "set_supply");

/* A light was latched by the LEDs. */
struct RECORD light_event {
    uint64_t first_bit_us; /* board clock when its transfer began */
    uint64_t latched_us; /* board clock when the last LED had taken it; it shows within one PWM period of the LED */
    uint32_t light_id;
    uint16_t repetition;
    uint16_t loop;
    uint16_t events_dropped; /* events lost before this one, since the start */
    uint8_t step; /* 0xFF: not of a sequence */
    uint8_t group; /* 0xFF: dark or not of a sequence */
};
_Static_assert(sizeof(struct light_event) == 28, "light_event");

/* The board made its LEDs dark by itself. */
struct RECORD dark_event {
    uint64_t time_us;
    uint16_t events_dropped;
    uint8_t dark; /* enum dark */
};
_Static_assert(sizeof(struct dark_event) == 11, "dark_event");

/* The board dims its LEDs by another amount than before, because chip, ring or housing has become hot or cool. */
struct RECORD dimmed_event {
    uint64_t time_us;
    int16_t temperature; /* as in StatusReply */
    uint16_t events_dropped;
    uint8_t dimmed; /* as in StatusReply; 0: not any more */
    uint16_t mean_ma; /* as in StatusReply */
    int16_t ring_temperature; /* as in StatusReply */
};
_Static_assert(sizeof(struct dimmed_event) == 17, "dimmed_event");

/* X(NAME, name, bytes of the request record, bytes of the reply record) for each command */
#define COMMANDS(X) \
    X(HELLO, hello, 0u, sizeof(struct hello_reply)) \
    X(CLOCK, clock, sizeof(struct clock_request), sizeof(struct clock_reply)) \
    X(SET_LEDS, set_leds, sizeof(struct set_leds), sizeof(struct light_reply)) \
    X(SET_GROUP, set_group, sizeof(struct set_group), sizeof(struct group_reply)) \
    X(SET_STEP, set_step, sizeof(struct set_step), 0u) \
    X(COMMIT, commit, sizeof(struct commit), 0u) \
    X(SET_SYNC, set_sync, sizeof(struct set_sync), 0u) \
    X(TRIM, trim, sizeof(struct trim), 0u) \
    X(START, start, 0u, 0u) \
    X(STOP, stop, 0u, 0u) \
    X(BLANK, blank, 0u, 0u) \
    X(STATUS, status, 0u, sizeof(struct status_reply)) \
    X(COUNTERS, counters, 0u, sizeof(struct counters_reply)) \
    X(GET_CONFIG, get_config, 0u, sizeof(struct configuration)) \
    X(SET_CONFIG, set_config, sizeof(struct configuration), 0u) \
    X(SAVE_CONFIG, save_config, 0u, 0u) \
    X(RESET, reset, sizeof(struct magic), 0u) \
    X(BOOTLOADER, bootloader, sizeof(struct magic), 0u) \
    X(SELFTEST, selftest, 0u, sizeof(struct self_test_reply)) \
    X(SET_SUPPLY, set_supply, sizeof(struct set_supply), 0u)

#endif
