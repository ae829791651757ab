/*
 * A small coverage-guided fuzzer for compilers without libFuzzer: build all but this file with
 * -fsanitize-coverage=trace-pc, which gcc and clang both know, and run it as
 *
 *     driver SECONDS SEED FOLDER FILE...
 *
 * It keeps every input that reaches new code, writes it to FOLDER (unless that is "-"), and prints what it did. An
 * input that ends the program by abort() is printed in hexadecimal.
 * With SECONDS 0 it runs the files once, in their order, and writes those that reach a place for the first time.
 */
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define INPUT_BYTES 1024u
#define INPUTS 4096u
#define MAP_BYTES 65536u

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed);
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t room);
void __sanitizer_cov_trace_pc(void);

struct input {
    uint8_t bytes[INPUT_BYTES];
    size_t count;
};

static struct input corpus[INPUTS];
static size_t corpus_count;
static uint8_t seen[MAP_BYTES], reached[MAP_BYTES];
static uint16_t touched[MAP_BYTES]; /* the slots that were reached */
static size_t touched_count;
static uint64_t random_state;
static int count_loops;

void __sanitizer_cov_trace_pc(void)
{
    uintptr_t place = (uintptr_t)__builtin_return_address(0);
    uint16_t slot = (uint16_t)((place ^ place >> 16) % MAP_BYTES);
    if (!reached[slot])
        touched[touched_count++] = slot;
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
    for (size_t i = 0; i < touched_count; i++) {
        uint16_t slot = touched[i];
        uint8_t hits = count_loops ? bucket(reached[slot]) : 1;
        if (hits & ~seen[slot])
            found = 1;
        seen[slot] |= hits;
        reached[slot] = 0;
    }
    touched_count = 0;
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

static const struct input *current;

static void tell_input(int signal_number)
{
    fprintf(stderr, "signal %d by the input ", signal_number);
    for (size_t i = 0; i < current->count; i++)
        fprintf(stderr, "%02x", current->bytes[i]);
    fputc('\n', stderr);
}

static int run(const struct input *input)
{
    current = input;
    LLVMFuzzerTestOneInput(input->bytes, input->count);
    return is_new();
}

/* One change that knows nothing of stories: another input behind this one, or a byte. */
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t room)
{
    const struct input *other = &corpus[chance((uint32_t)corpus_count)];
    if (chance(4) == 0 && other->count <= room - size) {
        memcpy(data + size, other->bytes, other->count);
        return size + other->count;
    }
    if (size)
        data[chance((uint32_t)size)] = (uint8_t)chance(256);
    return size;
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
        input.count = LLVMFuzzerCustomMutator(input.bytes, input.count, INPUT_BYTES, chance(UINT32_MAX));
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
    count_loops = seconds != 0;
    signal(SIGABRT, tell_input);
    random_state = strtoull(arguments[2], NULL, 10) | 1u;
    keep(&input, "-");
    for (int i = 4; i < count; i++) {
        read_input(&input, arguments[i]);
        if (run(&input))
            keep(&input, seconds ? "-" : arguments[3]);
    }
    uint64_t executions = fuzz(seconds, arguments[3]);
    size_t places = 0;
    for (size_t i = 0; i < MAP_BYTES; i++)
        places += seen[i] != 0;
    printf("%llu executions, %zu inputs, %zu places reached\n", (unsigned long long)executions, corpus_count, places);
    return 0;
}
