/*
 * A small coverage-guided fuzzer for compilers without libFuzzer: build it and the target with
 * -fsanitize-coverage=trace-pc, which gcc and clang both know, and run it as
 *
 *     driver SECONDS SEED FOLDER FILE...
 *
 * It keeps every input that reaches new code, writes it to FOLDER (unless that is "-"), and prints what it did.
 * With SECONDS 0 it runs the files once.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define INPUT_BYTES 1024u
#define INPUTS 4096u
#define MAP_BYTES 65536u

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
void __sanitizer_cov_trace_pc(void);

struct input {
    uint8_t bytes[INPUT_BYTES];
    size_t count;
};

static struct input corpus[INPUTS];
static size_t corpus_count;
static uint8_t seen[MAP_BYTES], reached[MAP_BYTES];
static uint64_t random_state;

__attribute__((no_sanitize_coverage)) void __sanitizer_cov_trace_pc(void)
{
    uintptr_t place = (uintptr_t)__builtin_return_address(0);
    uint32_t slot = (uint32_t)(place ^ place >> 16) % MAP_BYTES;
    if (reached[slot] < 255)
        reached[slot]++;
}

/* xorshift64* (Vigna 2016): the same seed gives the same run. */
static uint32_t chance(uint32_t below)
{
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return (uint32_t)((random_state * 2685821657736338717u) >> 33) % below;
}

/* Hit counts by powers of two, so that a loop that runs longer is new, but not each time round. */
static uint8_t bucket(uint8_t hits)
{
    uint8_t bits = 0;
    while (hits >> bits)
        bits++;
    return (uint8_t)(bits ? 1u << (bits - 1) : 0u);
}

static int is_new(void)
{
    int found = 0;
    for (size_t i = 0; i < MAP_BYTES; i++) {
        uint8_t hits = bucket(reached[i]);
        if (hits & ~seen[i])
            found = 1;
        seen[i] |= hits;
    }
    return found;
}

static void keep(const struct input *input, const char *folder)
{
    char name[512];
    if (corpus_count == INPUTS)
        return;
    corpus[corpus_count++] = *input;
    if (!strcmp(folder, "-"))
        return;
    snprintf(name, sizeof name, "%s/%06zu.bin", folder, corpus_count);
    FILE *file = fopen(name, "wb");
    if (!file || fwrite(input->bytes, 1, input->count, file) != input->count || fclose(file)) {
        perror(name);
        exit(2);
    }
}

static int run(const struct input *input)
{
    memset(reached, 0, sizeof reached);
    LLVMFuzzerTestOneInput(input->bytes, input->count);
    return is_new();
}

static void insert(struct input *input, size_t at, const uint8_t *bytes, size_t count)
{
    if (input->count + count > INPUT_BYTES)
        return;
    memmove(input->bytes + at + count, input->bytes + at, input->count - at);
    memcpy(input->bytes + at, bytes, count);
    input->count += count;
}

/* A packet of a random command with a random payload of a likely length, and a little time; at either end. */
static void insert_packet(struct input *input)
{
    static const uint8_t lengths[] = {0, 2, 3, 4, 7, 8, 12, 13, 27, 36, 37};
    uint8_t act[64] = {2, lengths[chance(sizeof lengths)], (uint8_t)(1 + chance(24))};
    uint8_t fill = (uint8_t)chance(256);
    uint32_t variety = chance(3);
    for (size_t i = 3; i < 3u + act[1]; i++)
        act[i] = variety == 0 ? fill : (uint8_t)(variety == 1 || !chance(3) ? chance(256) : chance(4));
    size_t count = 3u + act[1];
    act[count++] = 0;
    act[count++] = (uint8_t)chance(8);
    insert(input, chance(2) ? input->count : 0, act, count);
}

static void mutate(struct input *input)
{
    uint8_t byte = (uint8_t)chance(256);
    uint32_t at = input->count ? chance((uint32_t)input->count) : 0;
    const struct input *other = &corpus[chance((uint32_t)corpus_count)];
    switch (chance(6)) {
    case 0:
        insert_packet(input);
        break;
    case 1:
        insert(input, at, &byte, 1);
        break;
    case 2:
        insert(input, input->count, other->bytes, other->count);
        break;
    case 3:
        input->count = at;
        break;
    default:
        if (input->count && chance(2))
            input->bytes[at] = byte;
        else if (input->count)
            input->bytes[at] = (uint8_t)(input->bytes[at] ^ 1u << chance(8));
    }
}

static void read_input(struct input *input, const char *name)
{
    FILE *file = fopen(name, "rb");
    if (!file) {
        perror(name);
        exit(2);
    }
    input->count = fread(input->bytes, 1, INPUT_BYTES, file);
    fclose(file);
}

static uint64_t fuzz(uint64_t seconds, const char *folder)
{
    static struct input input;
    uint64_t executions = 0;
    for (time_t end = time(NULL) + (time_t)seconds; time(NULL) < end; executions++) {
        input = corpus[chance((uint32_t)corpus_count)];
        for (uint32_t i = 0, changes = 1 + chance(8); i < changes; i++)
            mutate(&input);
        if (run(&input))
            keep(&input, folder);
    }
    return executions;
}

int main(int count, char **arguments)
{
    static struct input input;
    if (count < 4)
        return 2;
    uint64_t seconds = strtoull(arguments[1], NULL, 10);
    random_state = strtoull(arguments[2], NULL, 10) | 1u;
    keep(&input, "-");
    for (int i = 4; i < count; i++) {
        read_input(&input, arguments[i]);
        run(&input);
        keep(&input, "-");
    }
    uint64_t executions = fuzz(seconds, arguments[3]);
    size_t places = 0;
    for (size_t i = 0; i < MAP_BYTES; i++)
        places += seen[i] != 0;
    printf("%llu executions, %zu inputs, %zu places reached\n", (unsigned long long)executions, corpus_count, places);
    return 0;
}
