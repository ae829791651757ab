#include "config.h"

#include <stddef.h>

#include "bytes.h"
#include "crc.h"

#define MAGIC 0x474c4346u
#define PAGES (PORT_SECTORS * PORT_SECTOR_BYTES / PORT_PAGE_BYTES)
#define SECTOR_PAGES (PORT_SECTOR_BYTES / PORT_PAGE_BYTES)
#define ATTEMPTS 4u
#define LAST_PIN 29u

struct record {
    uint32_t magic;
    uint32_t saves;
    struct configuration configuration;
    uint8_t blank[PORT_PAGE_BYTES - 12u - sizeof(struct configuration)];
    uint32_t crc;
} __attribute__((packed));
_Static_assert(sizeof(struct record) == PORT_PAGE_BYTES, "one record fills one page");

static void read_page(const struct port *port, uint32_t page, struct record *record)
{
    port->flash_read(port->context, page * PORT_PAGE_BYTES, record, sizeof *record);
}

static bool erased(const struct record *record)
{
    const uint8_t *bytes = (const uint8_t *)record;
    for (uint32_t i = 0; i < sizeof *record; i++)
        if (bytes[i] != 0xff)
            return false;
    return true;
}

void config_factory(struct config *config)
{
    config->current = (struct configuration){
        .host_timeout_ms = 1000,
        .limit_ma = CURRENT_CAP_MA,
        .quiescent_ua = 1000,
        .channel_ua = CHANNEL_USB_UA,
        .latch_us = 300,
        .name = "GelLight",
        .data_pin = DATA_PIN,
        .trigger_pin = TRIGGER_PIN,
        .led_count = LED_COUNT,
        .colour_order = COLOUR_ORDER_GRB,
        .status_pin = STATUS_PIN,
        .output_pin = NO_PIN,
        .output_at = OUTPUT_AT_START,
        .switch_pin = NO_PIN,
        .hottest_c = HOTTEST_C,
    };
}

static bool within(uint32_t value, uint32_t low, uint32_t high, uint32_t *refused)
{
    if (value >= low && value <= high)
        return true;
    *refused = value;
    return false;
}

static bool pin_valid(uint8_t pin, uint32_t *value)
{
    return pin == NO_PIN || within(pin, 0, LAST_PIN, value);
}

/* The number of a pin that may be active low. */
static uint8_t gpio(uint8_t pin)
{
    return pin == NO_PIN ? NO_PIN : (uint8_t)(pin & ~ACTIVE_LOW);
}

/* All pins are there, and none has two uses. */
static bool pins_valid(const struct configuration *candidate, uint32_t *value)
{
    const uint8_t pins[] = {candidate->data_pin, candidate->trigger_pin, gpio(candidate->status_pin),
                            candidate->output_pin, gpio(candidate->switch_pin)};
    uint32_t used = 0;
    for (uint32_t i = 0; i < sizeof pins; i++) {
        *value = pins[i];
        if (!pin_valid(pins[i], value) || (pins[i] != NO_PIN && used >> pins[i] & 1u))
            return false;
        used |= pins[i] == NO_PIN ? 0 : 1u << pins[i];
    }
    return within(candidate->data_pin, 0, LAST_PIN, value) && within(candidate->trigger_pin, 0, LAST_PIN, value);
}

bool config_valid(const struct configuration *candidate, uint32_t *value)
{
    uint32_t cap_ma = candidate->external_supply ? CURRENT_CAP_EXTERNAL_MA : CURRENT_CAP_MA;
    return within(candidate->host_timeout_ms, 100, 60000, value) &&
           within(candidate->external_supply, 0, 1, value) && within(candidate->limit_ma, 100, cap_ma, value) &&
           within(candidate->quiescent_ua, 0, 5000, value) &&
           within(candidate->channel_ua, CHANNEL_LEAST_UA, 60000, value) &&
           within(candidate->latch_us, 50, 500, value) && within(candidate->led_count, 1, MOST_LEDS, value) &&
           within(candidate->colour_order, 0, COLOUR_ORDER_RGBW, value) &&
           within(candidate->output_at, 0, OUTPUT_AT_MIDDLE, value) &&
           within(candidate->hottest_c, 40, 85, value) && pins_valid(candidate, value);
}

bool config_unconfirmed(const struct configuration *now, const struct configuration *candidate, uint32_t *value)
{
    uint32_t least_ua = candidate->external_supply ? CHANNEL_EXTERNAL_UA : CHANNEL_USB_UA;
    if (candidate->external_supply == now->external_supply && now->channel_ua < least_ua)
        least_ua = now->channel_ua;
    return within(candidate->external_supply, 0, now->external_supply, value) &&
           within(candidate->channel_ua, least_ua, 60000, value);
}

/* A record of firmware that did not know these fields has 0xff there; one of before 2.1 may undercut every LED. */
static void complete(struct configuration *configuration)
{
    struct config factory;
    if (configuration->channel_ua < CHANNEL_LEAST_UA)
        configuration->channel_ua = CHANNEL_EXTERNAL_UA;
    if (configuration->hottest_c == 0xff)
        configuration->hottest_c = HOTTEST_C;
    if (configuration->led_count != 0xff)
        return;
    config_factory(&factory);
    bytes_copy(&configuration->data_pin, &factory.current.data_pin,
               sizeof *configuration - offsetof(struct configuration, data_pin));
}

static bool intact(struct record *record)
{
    uint32_t value;
    bool sound = record->magic == MAGIC && record->crc == crc32(0, record, sizeof *record - 4u);
    complete(&record->configuration);
    return sound && config_valid(&record->configuration, &value);
}

void config_load(struct config *config, const struct port *port)
{
    struct record record;
    bytes_fill(config, 0, sizeof *config);
    config_factory(config);
    config->page = PAGES - 1; /* so that the first record goes to page 0 */
    for (uint16_t page = 0; page < PAGES; page++) {
        read_page(port, page, &record);
        if (!intact(&record) || record.saves <= config->saves)
            continue;
        config->saves = record.saves;
        config->page = page;
        config->stored = config->current = record.configuration;
    }
}

/* The page after the newest one; at the start of a sector that sector is erased first. */
static bool claim_page(uint32_t page, const struct port *port)
{
    struct record record;
    if (page % SECTOR_PAGES == 0)
        return port->flash_erase(port->context, page / SECTOR_PAGES);
    read_page(port, page, &record);
    return erased(&record);
}

static bool write_page(const struct config *config, uint32_t page, const struct port *port)
{
    struct record record, written;
    bytes_fill(&record, 0xff, sizeof record);
    record.magic = MAGIC;
    record.saves = config->saves + 1;
    record.configuration = config->current;
    record.crc = crc32(0, &record, sizeof record - 4u);
    if (!port->flash_program(port->context, page * PORT_PAGE_BYTES, (const uint8_t *)&record))
        return false;
    read_page(port, page, &written);
    return bytes_equal(&record, &written, sizeof record);
}

/* Never claim the sector of the newest record: stop before wrapping into it. */
static bool holds_newest(const struct config *config, uint32_t page)
{
    return config->saves && page % SECTOR_PAGES == 0 && page / SECTOR_PAGES == config->page / SECTOR_PAGES;
}

bool config_stored(const struct config *config)
{
    return config->saves && bytes_equal(&config->current, &config->stored, sizeof config->current);
}

bool config_save(struct config *config, const struct port *port)
{
    if (config_stored(config))
        return true;
    uint32_t page = config->page, failures = 0;
    for (uint32_t looked = 0; looked < PAGES && failures < ATTEMPTS; looked++) {
        page = (page + 1) % PAGES;
        if (holds_newest(config, page))
            break;
        if (!claim_page(page, port)) /* what a power cut left behind is skipped */
            continue;
        if (write_page(config, page, port)) {
            config->page = (uint16_t)page;
            config->saves++;
            config->stored = config->current;
            return true;
        }
        failures++;
        config->retries++;
    }
    return false;
}
