/* Calls functions of a library for the program at the other end of standard input and output, so that a library for another
 * processor can be tried in an emulator of programs (QEMU). Static, and without a C library: it needs nothing of the other
 * system.
 *
 * In: size and content of the library. Then for each call the name (32 bytes), the number of arguments, and each argument:
 * kind, value, and for an array its content. Out: what the function returns, then the content of all arrays. Numbers
 * are 8 bytes. It ends where the input ends. */
#include <elf.h>
#include <stddef.h>
#include <stdint.h>

enum { INTEGER, REAL, ARRAY };
#if defined(__aarch64__)
enum { READ = 63, WRITE = 64, EXIT = 93, MMAP = 222 };
enum { RELATIVE = R_AARCH64_RELATIVE, GLOBAL = R_AARCH64_GLOB_DAT, SLOT = R_AARCH64_JUMP_SLOT, WORD = R_AARCH64_ABS64 };
#else
enum { READ = 0, WRITE = 1, EXIT = 60, MMAP = 9 };
enum { RELATIVE = R_X86_64_RELATIVE, GLOBAL = R_X86_64_GLOB_DAT, SLOT = R_X86_64_JUMP_SLOT, WORD = R_X86_64_64 };
#endif
enum { MOST = 24, PAGE = 4096 };
/* Whole numbers and addresses travel in other registers than floats, so one type fits all functions of the frame path. */
typedef int32_t (*Function)(int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t,
                            int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, float, float, float, float);

static char *base;
static const Elf64_Sym *symbols;
static const char *names;
static size_t symbol_count;

static int64_t system_call(int64_t number, int64_t a, int64_t b, int64_t c, int64_t d, int64_t e) {
#if defined(__aarch64__)
    register int64_t x8 __asm__("x8") = number, x0 __asm__("x0") = a, x1 __asm__("x1") = b, x2 __asm__("x2") = c,
                         x3 __asm__("x3") = d, x4 __asm__("x4") = e, x5 __asm__("x5") = 0;
    __asm__ volatile("svc 0" : "+r"(x0) : "r"(x8), "r"(x1), "r"(x2), "r"(x3), "r"(x4), "r"(x5) : "memory");
    return x0;
#else
    register int64_t r10 __asm__("r10") = d, r8 __asm__("r8") = e, r9 __asm__("r9") = 0;
    int64_t result = number;
    __asm__ volatile("syscall" : "+a"(result) : "D"(a), "S"(b), "d"(c), "r"(r10), "r"(r8), "r"(r9) : "rcx", "r11", "memory");
    return result;
#endif
}

__attribute__((noreturn)) static void finish(int64_t status) {
    for (;;) system_call(EXIT, status, 0, 0, 0, 0);
}

void *memcpy(void *restrict to, const void *restrict from, size_t size) {
    for (size_t i = 0; i < size; i++) ((char *)to)[i] = ((const char *)from)[i];
    return to;
}

void *memset(void *to, int value, size_t size) {
    for (size_t i = 0; i < size; i++) ((char *)to)[i] = (char)value;
    return to;
}

static int equal(const char *a, const char *b) {
    while (*a && *a == *b) a++, b++;
    return *a == *b;
}

/* All of `size` bytes; the program ends where there are no more. */
static void receive(void *to, size_t size) {
    for (size_t done = 0; done < size;) {
        const int64_t got = system_call(READ, 0, (int64_t)to + (int64_t)done, (int64_t)(size - done), 0, 0);
        if (got <= 0) finish(done ? 3 : 0);
        done += (size_t)got;
    }
}

static void answer(const void *from, size_t size) {
    for (size_t done = 0; done < size;) {
        const int64_t put = system_call(WRITE, 1, (int64_t)from + (int64_t)done, (int64_t)(size - done), 0, 0);
        if (put <= 0) finish(4);
        done += (size_t)put;
    }
}

/* Fresh memory, for data and code. */
static void *memory(size_t size) {
    const int64_t at = system_call(MMAP, 0, (int64_t)size, 7, 0x22, -1);
    if (at < 0 && at > -PAGE) finish(5);
    return (void *)at;
}

static uint64_t address_of(const Elf64_Sym *symbol) {
    if (symbol->st_shndx != SHN_UNDEF) return (uint64_t)base + symbol->st_value;
    if (equal(names + symbol->st_name, "memcpy")) return (uint64_t)memcpy;
    if (equal(names + symbol->st_name, "memset")) return (uint64_t)memset;
    finish(6);
}

static void relocate(const Elf64_Rela *table, size_t size) {
    for (size_t i = 0; i < size / sizeof *table; i++) {
        uint64_t *where = (uint64_t *)(base + table[i].r_offset);
        const uint64_t kind = ELF64_R_TYPE(table[i].r_info), added = (uint64_t)table[i].r_addend;
        if (kind == RELATIVE)
            *where = (uint64_t)base + added;
        else if (kind == GLOBAL || kind == SLOT || kind == WORD)
            *where = address_of(symbols + ELF64_R_SYM(table[i].r_info)) + added;
        else
            finish(7);
    }
}

/* Lay out the segments of a library as a dynamic linker does. */
static void load(const char *file) {
    const Elf64_Ehdr *head = (const Elf64_Ehdr *)file;
    const Elf64_Phdr *parts = (const Elf64_Phdr *)(file + head->e_phoff);
    const Elf64_Shdr *sections = (const Elf64_Shdr *)(file + head->e_shoff);
    size_t size = 0, sizes[2] = {0, 0};
    const Elf64_Rela *tables[2] = {0, 0};
    for (int i = 0; i < head->e_phnum; i++)
        if (parts[i].p_type == PT_LOAD) size = parts[i].p_vaddr + parts[i].p_memsz;
    base = memory(size);
    for (int i = 0; i < head->e_phnum; i++)
        if (parts[i].p_type == PT_LOAD) memcpy(base + parts[i].p_vaddr, file + parts[i].p_offset, parts[i].p_filesz);
    for (int i = 0; i < head->e_shnum; i++)
        if (sections[i].sh_type == SHT_DYNSYM) symbol_count = sections[i].sh_size / sizeof *symbols;
    for (int i = 0; i < head->e_phnum; i++) {
        if (parts[i].p_type != PT_DYNAMIC) continue;
        for (const Elf64_Dyn *entry = (const Elf64_Dyn *)(base + parts[i].p_vaddr); entry->d_tag != DT_NULL; entry++) {
            const uint64_t value = entry->d_un.d_val;
            if (entry->d_tag == DT_SYMTAB) symbols = (const Elf64_Sym *)(base + value);
            if (entry->d_tag == DT_STRTAB) names = base + value;
            if (entry->d_tag == DT_RELA) tables[0] = (const Elf64_Rela *)(base + value);
            if (entry->d_tag == DT_RELASZ) sizes[0] = value;
            if (entry->d_tag == DT_JMPREL) tables[1] = (const Elf64_Rela *)(base + value);
            if (entry->d_tag == DT_PLTRELSZ) sizes[1] = value;
        }
    }
    for (int i = 0; i < 2; i++) relocate(tables[i], sizes[i]);
}

static Function function_named(const char *name) {
    for (size_t i = 0; i < symbol_count; i++)
        if (symbols[i].st_shndx != SHN_UNDEF && equal(names + symbols[i].st_name, name))
            return (Function)(base + symbols[i].st_value);
    finish(8);
}

/* One call; its arrays lie in `heap`, of 1 GiB, of which only what is written takes memory. */
static void serve(char *heap) {
    char name[32];
    int64_t count, words[MOST] = {0}, sizes[MOST] = {0}, whole = 0, real = 0;
    float reals[4] = {0, 0, 0, 0};
    char *at = heap, *arrays[MOST] = {0};
    receive(name, sizeof name);
    receive(&count, sizeof count);
    for (int64_t i = 0; i < count; i++) {
        int64_t kind, value;
        receive(&kind, sizeof kind);
        receive(&value, sizeof value);
        if (kind == REAL) {
            memcpy(&reals[real++], &value, sizeof reals[0]);
        } else if (kind == INTEGER) {
            words[whole++] = value;
        } else {
            receive(at, (size_t)value);
            arrays[i] = at;
            sizes[i] = value;
            words[whole++] = (int64_t)at;
            at += (value + PAGE - 1) / PAGE * PAGE;
        }
    }
    const Function run = function_named(name);
    const int64_t result = run(words[0], words[1], words[2], words[3], words[4], words[5], words[6], words[7], words[8],
                               words[9], words[10], words[11], words[12], words[13], words[14], words[15], reals[0],
                               reals[1], reals[2], reals[3]);
    answer(&result, sizeof result);
    for (int64_t i = 0; i < count; i++)
        if (arrays[i]) answer(arrays[i], (size_t)sizes[i]);
}

#if defined(__x86_64__)
__attribute__((force_align_arg_pointer))
#endif
__attribute__((noreturn)) void _start(void) {
    int64_t size;
    receive(&size, sizeof size);
    char *file = memory((size_t)size);
    receive(file, (size_t)size);
    load(file);
    char *heap = memory((size_t)1 << 30);
    for (;;) serve(heap);
}
