/* CRC-32 as in zlib and Ethernet, one byte at a time. The table is in the program's memory. Its entries are linear in
   the bits of the index (by exclusive or), so eight constants generate the whole table. */
#ifndef OPTOPAD_CRC_H
#define OPTOPAD_CRC_H
#include <stdint.h>
#ifdef __AVR__ /* an AVR reads its program memory by separate instructions */
#include <avr/pgmspace.h>
#define IN_PROGRAM PROGMEM
#define program_byte(at) pgm_read_byte(at)
#define program_number(at) pgm_read_dword(at)
#else
#define IN_PROGRAM
#define program_byte(at) (*(at))
#define program_number(at) (*(at))
#endif

#define CRC_BIT(i, bit, value) ((i) & (1 << (bit)) ? value : 0)
#define CRC_1(i)                                                                                                       \
    (CRC_BIT(i, 0, 0x77073096UL) ^ CRC_BIT(i, 1, 0xee0e612cUL) ^ CRC_BIT(i, 2, 0x076dc419UL) ^                          \
     CRC_BIT(i, 3, 0x0edb8832UL) ^ CRC_BIT(i, 4, 0x1db71064UL) ^ CRC_BIT(i, 5, 0x3b6e20c8UL) ^                          \
     CRC_BIT(i, 6, 0x76dc4190UL) ^ CRC_BIT(i, 7, 0xedb88320UL))
#define CRC_4(i) CRC_1(i), CRC_1((i) + 1), CRC_1((i) + 2), CRC_1((i) + 3)
#define CRC_16(i) CRC_4(i), CRC_4((i) + 4), CRC_4((i) + 8), CRC_4((i) + 12)
#define CRC_64(i) CRC_16(i), CRC_16((i) + 16), CRC_16((i) + 32), CRC_16((i) + 48)
static const uint32_t crc_table[256] IN_PROGRAM = {CRC_64(0), CRC_64(64), CRC_64(128), CRC_64(192)};

static inline uint32_t crc_after(uint32_t crc, uint8_t byte) {
    return program_number(&crc_table[(uint8_t)crc ^ byte]) ^ (crc >> 8);
}

static uint32_t crc_of(const uint8_t *bytes, uint8_t count) {
    uint32_t crc = 0xffffffffUL;
    while (count--) crc = crc_after(crc, *bytes++);
    return ~crc;
}
#endif
