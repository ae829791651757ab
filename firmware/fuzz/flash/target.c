/*
 * The configuration in flash that anything may have happened to. One input is a list of acts of 8 bytes:
 *
 *   0 page from count x x x x     rubbish in a page, as a write that broke off leaves it
 *   1 page saves16 field value..  a sound record, its configuration changed in up to two bytes
 *   2 cut16 field value ..        change up to two bytes of the configuration, save it; after `cut` bytes power fails, 0: not
 *   3 sector                      an erased sector
 *
 * After each act the board starts anew: what it finds is a configuration that it would accept, the built-in one where
 * there is no sound record. What was saved is found again; after a power cut, that or what was there before.
 */
#include <stdlib.h>
#include <string.h>

#include "../chance.h"
#include "bytes.h"
#include "config.h"
#include "crc.h"

#define FLASH_BYTES (PORT_SECTORS * PORT_SECTOR_BYTES)
#define PAGES (FLASH_BYTES / PORT_PAGE_BYTES)
#define ACT_BYTES 8u
#define MOST_ACTS 12u /* records may lie at the end of a sector, so few saves go over it */
#define MAGIC 0x474c4346u

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed);
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t room);

static uint8_t flash[FLASH_BYTES];
static uint32_t left; /* bytes that change before power fails, UINT32_MAX: it does not */
static struct config config;

static void require(bool holds)
{
    if (!holds)
        abort();
}

static bool change(uint32_t at, uint8_t value)
{
    if (!left)
        return false;
    left -= left != UINT32_MAX;
    flash[at] = value;
    return true;
}

static void flash_read(void *context, uint32_t offset, void *to, size_t count)
{
    (void)context;
    require(offset <= FLASH_BYTES && count <= FLASH_BYTES - offset);
    memcpy(to, flash + offset, count);
}

static bool flash_erase(void *context, uint32_t sector)
{
    (void)context;
    require(sector < PORT_SECTORS);
    for (uint32_t i = 0; i < PORT_SECTOR_BYTES; i++)
        if (!change(sector * PORT_SECTOR_BYTES + i, 0xff))
            return false;
    return true;
}

static bool flash_program(void *context, uint32_t offset, const uint8_t *page)
{
    (void)context;
    require(offset % PORT_PAGE_BYTES == 0 && offset < FLASH_BYTES);
    for (uint32_t i = 0; i < PORT_PAGE_BYTES; i++)
        if (!change(offset + i, flash[offset + i] & page[i]))
            return false;
    return true;
}

static const struct port port = {.flash_read = flash_read, .flash_erase = flash_erase, .flash_program = flash_program};

static void alter(struct configuration *configuration, const uint8_t *changes)
{
    uint8_t *bytes = (uint8_t *)configuration;
    for (uint32_t i = 0; i < 4; i += 2)
        if (changes[i] < sizeof *configuration)
            bytes[changes[i]] = changes[i + 1];
}

static void spoil(const uint8_t *act)
{
    uint32_t page = act[1] % PAGES;
    for (uint32_t i = 0; i < act[3]; i++)
        flash[page * PORT_PAGE_BYTES + (act[2] + i) % PORT_PAGE_BYTES] &= act[4 + i % 4];
}

static void put_record(const uint8_t *act)
{
    uint8_t *page = flash + act[1] % PAGES * PORT_PAGE_BYTES;
    uint32_t head[] = {MAGIC, 1u + act[2] + 256u * act[3]}, crc;
    struct config made;
    config_factory(&made);
    alter(&made.current, act + 4);
    memset(page, 0xff, PORT_PAGE_BYTES);
    memcpy(page, head, sizeof head);
    memcpy(page + sizeof head, &made.current, sizeof made.current);
    crc = crc32(0, page, PORT_PAGE_BYTES - 4u);
    memcpy(page + PORT_PAGE_BYTES - 4u, &crc, 4);
}

static bool same(const struct configuration *a, const struct configuration *b)
{
    return bytes_equal(a, b, sizeof *a);
}

static void start(void)
{
    struct config factory;
    uint32_t value;
    left = UINT32_MAX;
    config_load(&config, &port);
    config_factory(&factory);
    require(config_valid(&config.current, &value));
    require(config.saves || same(&config.current, &factory.current));
}

/* As SET_CONFIG and SAVE_CONFIG do it. */
static void save(const uint8_t *act)
{
    struct configuration before = config.current, wanted = config.current;
    uint32_t value, cut = act[1] + 256u * act[2], saves = config.saves;
    alter(&wanted, act + 4);
    if (!config_valid(&wanted, &value))
        return;
    config.current = wanted;
    left = cut ? cut : UINT32_MAX;
    bool saved = config_save(&config, &port);
    start();
    require(same(&config.current, &wanted) || same(&config.current, &before));
    require(!saved || same(&config.current, &wanted));
    require(config.saves == saves || config.saves == saves + 1u);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    memset(flash, 0xff, sizeof flash);
    start();
    for (size_t at = 0; at + ACT_BYTES <= size; at += ACT_BYTES) {
        const uint8_t *act = data + at;
        if (act[0] % 4 == 0)
            spoil(act);
        else if (act[0] % 4 == 1)
            put_record(act);
        else if (act[0] % 4 == 2)
            save(act);
        else
            memset(flash + act[1] % PORT_SECTORS * PORT_SECTOR_BYTES, 0xff, PORT_SECTOR_BYTES);
        if (act[0] % 4 != 2) /* which has started it */
            start();
    }
    return 0;
}

static void write_act(uint8_t act[ACT_BYTES])
{
    static const uint8_t kinds[] = {0, 1, 2, 2, 2, 2, 2, 3};
    for (uint32_t i = 0; i < ACT_BYTES; i++)
        act[i] = (uint8_t)chance(256);
    act[0] = kinds[chance(chance(8) ? 7 : 8)];
    if (act[0] == 2 && chance(2))
        act[1] = act[2] = 0; /* no power cut */
    if (act[0] == 2)
        act[4] = (uint8_t)(chance(3) ? 12u + chance(16) : chance(48)); /* the name, which may be anything */
    act[6] = chance(3) ? 0xffu : act[6];
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed)
{
    state = seed | 1u;
    if (!chance(8))
        return LLVMFuzzerMutate(data, size, room);
    if (!chance(8))
        size = chance((uint32_t)(size / ACT_BYTES) + 1u) * ACT_BYTES;
    for (uint32_t more = 1u + chance(6); more && size + ACT_BYTES <= room && size < MOST_ACTS * ACT_BYTES; more--) {
        size_t at = chance((uint32_t)(size / ACT_BYTES) + 1u) * ACT_BYTES;
        memmove(data + at + ACT_BYTES, data + at, size - at);
        write_act(data + at);
        size += ACT_BYTES;
    }
    return size;
}
