/* Code for all boards: messages, commands, and the time of the next frame. `core.c` (AVR chips) or `core.cpp` (boards
   with another Arduino core) includes this file and defines the functions that are declared first.

   All numbers are little-endian; every message ends with the CRC-32 of all preceding bytes.
     readings   A5 5A 10, sequence u32, microseconds u32 when the first conversion began, readings packed bit by bit
     hello      A5 5A 11, version u8 u8, board, emitters, receivers, bits (plus 128 if each emitter has a dark state
                before and after it), prescaler exponent u8, settle us u16, baud u32, frame interval us u32,
                design digest 32 bytes
     self-test  A5 5A 12, reading of the 1.1 V reference u16, late frames u32, least free RAM u16, config CRC u32
     commands   C5 5C, version and command u8, argument u32 */
#ifndef OPTOPAD_SESSION_H
#define OPTOPAD_SESSION_H
#include "config.h"
#include "crc.h"

#include <stdbool.h>
#include <stdint.h>

#define FIRMWARE_MAJOR 1
#define FIRMWARE_MINOR 0
#define PROTOCOL_VERSION 1

enum kind { KIND_READINGS, KIND_HELLO, KIND_SELF_TEST };
enum command { COMMAND_START = 1, COMMAND_STOP, COMMAND_RATE, COMMAND_IDENTIFY, COMMAND_TEST };

#define N_STATES (DARK_AROUND_EACH ? 2 * N_EMITTERS + 1 : N_EMITTERS + 1)
#define HEAD_BYTES 3
#define CRC_BYTES 4
#define FRAME_BYTES (HEAD_BYTES + 8 + (1UL * N_STATES * N_RECEIVERS * ADC_BITS + 7) / 8 + CRC_BYTES)
#define HELLO_BYTES 56
#define COMMAND_BYTES 11
#define COMMAND_MAGIC_1 0xc5
#define COMMAND_MAGIC_2 0x5c
#define BUFFER_BYTES (FRAME_BYTES > HELLO_BYTES ? FRAME_BYTES : HELLO_BYTES)
#define HEARD_BYTES 64 /* must be a power of two; holds a burst of five commands */
#define HELLO_INTERVAL_US 1000000UL
#define LONGEST_INTERVAL_US 0x7fffffffUL
#ifndef FIRST_SEQUENCE
#define FIRST_SEQUENCE 0
#endif

static uint32_t clock_us(void);        /* since reset, wrapping at 32 bits */
static bool can_fill(void);            /* whether a buffer is free to be filled */
static void send_filled(uint8_t *end); /* sends the filled buffer; the other one is filled next */
static bool has_heard(void);
static uint8_t next_heard(void);
static void read_frame(void);
static void drop_frame(void); /* discards a frame that has begun, and leaves no emitter lit */
static uint16_t reference_reading(void);
static uint16_t least_free_ram(void);

typedef struct {
    uint8_t *at;
    uint32_t crc;
} message;

/* Bytes that identify the program's design; the host has the same bytes. Hello repeats the first 47. */
static const uint8_t config_block[] IN_PROGRAM = {
    BOARD_NUMBER, N_EMITTERS, N_RECEIVERS, ADC_BITS | DARK_AROUND_EACH << 7, PRESCALER_EXPONENT, U16(SETTLE_US),
    U32(BAUD), U32(FRAME_INTERVAL_US), DESIGN_DIGEST, EMITTER_PINS, CHANNEL_NUMBERS MORE_CONFIG};
#define INTERVAL_AT 11
#define HELLO_CONFIG_BYTES 47

static uint8_t buffers[2][BUFFER_BYTES];
static uint8_t filling;

static uint8_t command[COMMAND_BYTES], command_length;

static uint32_t said_hello_us, due_us, interval_us = FRAME_INTERVAL_US, late_frames;
static uint32_t sequence = FIRST_SEQUENCE;
static bool is_running, has_waited;

static uint32_t config_crc(void) {
    uint32_t crc = 0xffffffffUL;
    for (uint16_t i = 0; i < sizeof config_block; i++) crc = crc_after(crc, program_byte(&config_block[i]));
    return ~crc;
}

/* ---- messages */

static uint8_t *put(uint8_t *at, uint32_t value, uint8_t bytes) {
    for (; bytes; bytes--, value >>= 8) *at++ = value;
    return at;
}

static uint8_t *put_head(uint8_t *at, enum kind kind) {
    *at++ = 0xa5;
    *at++ = 0x5a;
    *at++ = PROTOCOL_VERSION << 4 | kind;
    return at;
}

static void send_message(uint8_t *end) {
    uint8_t *start = buffers[filling];
    send_filled(put(end, crc_of(start, end - start), CRC_BYTES));
}

static inline __attribute__((always_inline)) void pack_byte(message *frame, uint8_t byte) {
    *frame->at++ = byte;
    frame->crc = crc_after(frame->crc, byte);
}

static inline __attribute__((always_inline)) void pack_number(message *frame, uint32_t value) {
    for (uint8_t i = 0; i < 4; i++, value >>= 8) pack_byte(frame, value);
}

static inline __attribute__((always_inline)) void open_frame(message *frame, uint32_t began_us) {
    frame->at = buffers[filling];
    frame->crc = 0xffffffffUL;
    pack_byte(frame, 0xa5);
    pack_byte(frame, 0x5a);
    pack_byte(frame, PROTOCOL_VERSION << 4 | KIND_READINGS);
    pack_number(frame, sequence++);
    pack_number(frame, began_us);
}

static inline __attribute__((always_inline)) void close_frame(message *frame) {
    send_filled(put(frame->at, ~frame->crc, CRC_BYTES));
}

/* Whether the next frame is due. The frame counts as late if it was due before the last frame was finished. */
static bool frame_is_due(void) {
    uint32_t now_us;
    if (!interval_us) return true;
    now_us = clock_us();
    if ((int32_t)(now_us - due_us) < 0) {
        has_waited = true;
        return false;
    }
    if (!has_waited) {
        late_frames++;
        due_us = now_us;
    }
    due_us += interval_us;
    has_waited = false;
    return true;
}

/* ---- messages other than frames */

static void say_hello(void) {
    uint8_t *at = put_head(buffers[filling], KIND_HELLO);
    *at++ = FIRMWARE_MAJOR;
    *at++ = FIRMWARE_MINOR;
    for (uint8_t i = 0; i < HELLO_CONFIG_BYTES; i++) at[i] = program_byte(&config_block[i]);
    put(at + INTERVAL_AT, interval_us, 4);
    send_message(at + HELLO_CONFIG_BYTES);
    said_hello_us = clock_us();
}

static void test_oneself(void) {
    uint8_t *at = put_head(buffers[filling], KIND_SELF_TEST);
    at = put(at, reference_reading(), 2);
    at = put(at, late_frames, 4);
    at = put(at, least_free_ram(), 2);
    send_message(put(at, config_crc(), 4));
}

/* ---- commands */

static void restart_interval(void) {
    due_us = clock_us();
    has_waited = true;
}

static void obey(uint8_t order, uint32_t argument) {
    drop_frame();
    if (order == COMMAND_START && !is_running) {
        is_running = true;
        restart_interval();
    } else if (order == COMMAND_STOP) {
        is_running = false;
        said_hello_us = clock_us();
    } else if (order == COMMAND_RATE && argument <= LONGEST_INTERVAL_US) {
        interval_us = argument;
        restart_interval();
    } else if (order == COMMAND_IDENTIFY) {
        say_hello();
    } else if (order == COMMAND_TEST) {
        test_oneself();
    }
}

static uint32_t number_at(const uint8_t *bytes) {
    return (uint32_t)bytes[3] << 24 | (uint32_t)bytes[2] << 16 | (uint16_t)bytes[1] << 8 | bytes[0];
}

static bool is_command(void) {
    return command[0] == COMMAND_MAGIC_1 && command[1] == COMMAND_MAGIC_2 && command[2] >> 4 == PROTOCOL_VERSION &&
           number_at(command + 7) == crc_of(command, COMMAND_BYTES - CRC_BYTES);
}

/* Drops the first byte of a false command, and further bytes up to the next one that may begin a command. */
static void look_further(void) {
    uint8_t from = 1, kept = 0;
    while (from < command_length && command[from] != COMMAND_MAGIC_1) from++;
    while (from < command_length) command[kept++] = command[from++];
    command_length = kept;
}

/* Reads at most as many bytes as the ring buffer holds, so that a host that sends without a pause does not stop the
   frames. */
static void take_commands(void) {
    for (uint8_t left = HEARD_BYTES; left && can_fill() && has_heard(); left--) {
        command[command_length++] = next_heard();
        if (command[0] != COMMAND_MAGIC_1) {
            command_length = 0;
        } else if (command_length == COMMAND_BYTES) {
            if (is_command()) {
                command_length = 0;
                obey(command[2] & 15, number_at(command + 3));
            } else {
                look_further();
            }
        }
    }
}

static void step(void) {
    if (!can_fill()) return; /* once a buffer is free, commands are handled before the next frame */
    take_commands();
    if (!can_fill()) return;
    if (is_running) {
        if (frame_is_due()) read_frame();
    } else if (clock_us() - said_hello_us >= HELLO_INTERVAL_US) {
        say_hello();
    }
}
#endif
