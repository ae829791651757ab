/* Checksums: CRC-16/CCITT-FALSE for packets, CRC-32 (zlib's) for flash records, tables and images. */
#ifndef GELLIGHT_CRC_H
#define GELLIGHT_CRC_H

#include <stddef.h>
#include <stdint.h>

uint16_t crc16(const uint8_t *bytes, size_t count);

/* Continue a CRC-32 that began with crc = 0. */
uint32_t crc32(uint32_t crc, const void *bytes, size_t count);

#endif
