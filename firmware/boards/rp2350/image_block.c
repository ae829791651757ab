/*
 * What the boot ROM of the RP2350 looks for in the first 4 KiB (data sheet 5.9.5.1): that this is a program for its Arm
 * processors in the secure state. The vectors are where the flash begins. One block, linked to itself.
 */
#include <stdint.h>

#define BLOCK_START 0xffffded3u
#define IMAGE_TYPE 0x42u
#define PROGRAM_SECURE_ARM_RP2350 0x1021u
#define LAST_ITEM 0xffu
#define BLOCK_END 0xab123579u

__attribute__((section(".image_block"), used)) static const uint32_t image_block[] = {
    BLOCK_START,
    PROGRAM_SECURE_ARM_RP2350 << 16 | 1u << 8 | IMAGE_TYPE, /* an item of one word */
    1u << 8 | LAST_ITEM,                                    /* one word of items before it */
    0,                                                      /* to the next block: this one */
    BLOCK_END,
};
