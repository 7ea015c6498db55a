/* Firmware of an optopad sensor on an AVR board: lights one emitter after another, then none, reads every receiver in
   each of these states, and sends what it read as binary frames. Everything that belongs to one design is in config.h.

   Pipelined: the next conversion is started before the reading of the last one is packed, so packing and checksum cost
   no time. The line is served by interrupts from the buffer that is not being filled. A state is read no sooner than
   SETTLE_US after its emitter was switched. Emitters are switched between conversions, so that none sees the step of
   the supply; with SWITCH_EARLY they are switched during a state's last conversion, once its input is held.

   All numbers little-endian; every message ends with the CRC-32 of everything before it.
     readings   A5 5A 10, sequence u32, microseconds u32 when the first conversion began, readings of 10 bits packed
     hello      A5 5A 11, version u8 u8, board, emitters, receivers, bits, prescaler exponent u8, settle us u16,
                baud u32, frame interval us u32, design digest 32 bytes
     self-test  A5 5A 12, reading of the 1.1 V reference u16, late frames u32, least free RAM u16, config CRC u32
     commands   C5 5C, version and command u8, argument u32 */
#pragma GCC optimize("O2")

#include "config.h"
#include "core.h"

#include <avr/io.h>
#include <avr/pgmspace.h>
#include <stdbool.h>
#include <stdint.h>

#define FIRMWARE_MAJOR 1
#define FIRMWARE_MINOR 0
#define PROTOCOL_VERSION 1

#if F_CPU != CLOCK_HZ
#error "the program is compiled for another clock than the design's board has"
#endif
#if CLOCK_HZ % 8000000UL
#error "the microsecond clock needs a whole number of ticks a microsecond: a clock of 8 or 16 MHz"
#endif
#if ADC_BITS != 10
#error "readings are packed for a converter of 10 bits"
#endif

enum kind { READINGS, HELLO, SELF_TEST };
enum command { START = 1, STOP, RATE, IDENTIFY, TEST };

#define N_STATES (N_EMITTERS + 1)
#define HEAD_BYTES 3
#define CRC_BYTES 4
#define FRAME_BYTES (HEAD_BYTES + 8 + (1UL * N_STATES * N_RECEIVERS * ADC_BITS + 7) / 8 + CRC_BYTES)
#define HELLO_BYTES 56
#define COMMAND_BYTES 11
#define COMMAND_MAGIC_1 0xc5
#define COMMAND_MAGIC_2 0x5c
#define BUFFER_BYTES (FRAME_BYTES > HELLO_BYTES ? FRAME_BYTES : HELLO_BYTES)
#define HELLO_INTERVAL_US 1000000UL
#define REFERENCE_US 2000 /* the reference and its weak drive of the input have settled long before */
#define LONGEST_INTERVAL_US 0x7fffffffUL
#define SETTLE_TICKS (SETTLE_US * TICKS_PER_US + 1)
/* The input is held 1.5 converter's clocks after at most one of waiting. */
#define HOLD_TICKS ((3UL << PRESCALER_EXPONENT) / 8 + 1)
#define FRESH_RAM 0xa7
#ifndef FIRST_SEQUENCE
#define FIRST_SEQUENCE 0
#endif

#include "crc.h"
#include "line.h"

typedef struct {
    volatile uint8_t *port, *direction;
    uint8_t mask;
} emitter_pin;

/* A change of light, looked up before its moment comes. */
typedef struct {
    volatile uint8_t *off_port, *on_port;
    uint8_t off_mask, on_mask;
    const emitter_pin *next;
} change;

typedef struct {
    uint8_t *at;
    uint32_t crc;
    uint8_t held_bits, phase;
} packer;

#define LED(letter, bit) {&PORT##letter, &DDR##letter, 1 << (bit)}
#define NO_LED {&GPIOR0, &GPIOR0, 0} /* the dark state switches nothing, in a register that does nothing */
static const emitter_pin emitters[N_STATES] = {EMITTERS, NO_LED};
#define FIRST emitters
#define DARK (emitters + N_EMITTERS)
static const uint8_t channel_mux[N_RECEIVERS] = {CHANNEL_MUX};

/* What makes this program the one of its design; the host knows the same bytes. Hello repeats the first 47. */
static const uint8_t config_block[] PROGMEM = {
    BOARD_NUMBER, N_EMITTERS, N_RECEIVERS, ADC_BITS, PRESCALER_EXPONENT, U16(SETTLE_US), U32(BAUD),
    U32(FRAME_INTERVAL_US), DESIGN_DIGEST, EMITTER_PINS, CHANNEL_NUMBERS};
#define INTERVAL_AT 11
#define HELLO_CONFIG_BYTES 47

static uint8_t command[COMMAND_BYTES], command_length;

static uint32_t said_hello_us, due_us, began_us, interval_us = FRAME_INTERVAL_US, late_frames;
static uint32_t sequence = FIRST_SEQUENCE;
static bool is_running, is_converting, has_waited;
static const emitter_pin *lit = DARK;
static uint16_t switched_at;
#if SWITCH_EARLY
static uint8_t started_at;
#endif

static uint32_t config_crc(void) {
    uint32_t crc = 0xffffffffUL;
    for (uint16_t i = 0; i < sizeof config_block; i++) crc = crc_after(crc, pgm_read_byte(&config_block[i]));
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

/* ---- emitters and converter */

static inline change change_to(const emitter_pin *next) {
    return (change){lit->port, next->port, ~lit->mask, next->mask, next};
}

static inline void make(change now) {
    *now.off_port &= now.off_mask;
    *now.on_port |= now.on_mask;
    switched_at = TCNT1;
    lit = now.next;
}

static inline void select_input(uint8_t mux) {
    ADMUX = _BV(REFS0) | (mux & 31); /* full scale is the supply */
#if ANY_MUX5
    ADCSRB = mux & 32 ? _BV(MUX5) : 0;
#endif
}

static inline void start_conversion(void) {
    ADCSRA = _BV(ADEN) | _BV(ADSC) | PRESCALER_EXPONENT;
#if SWITCH_EARLY
    started_at = TCNT1L;
#endif
}

static inline void wait_for_conversion(void) {
    while (ADCSRA & _BV(ADSC)) {}
}

static inline void wait_until_settled(void) {
    while ((uint16_t)(TCNT1 - switched_at) < SETTLE_TICKS) {}
}

static inline void wait_until_held(void) {
#if SWITCH_EARLY
    while ((uint8_t)(TCNT1L - started_at) < HOLD_TICKS) {}
#endif
}

static void begin_frame(void) {
    select_input(channel_mux[0]);
    if (lit != FIRST) make(change_to(FIRST));
    wait_until_settled();
    start_conversion();
    began_us = clock_us();
    is_converting = true;
}

static void drop_conversion(void) {
    wait_for_conversion();
    make(change_to(DARK));
    is_converting = false;
}

/* ---- a frame */

static inline __attribute__((always_inline)) void pack_byte(packer *frame, uint8_t byte) {
    *frame->at++ = byte;
    frame->crc = crc_after(frame->crc, byte);
}

static inline __attribute__((always_inline)) void pack_number(packer *frame, uint32_t value) {
    for (uint8_t i = 0; i < 4; i++, value >>= 8) pack_byte(frame, value);
}

/* Ten bits, the least significant first, after those that are held already. */
static inline __attribute__((always_inline)) void pack_reading(packer *frame, uint16_t reading) {
    switch (frame->phase++) {
    case 0:
        pack_byte(frame, reading);
        frame->held_bits = reading >> 8;
        break;
    case 1:
        pack_byte(frame, frame->held_bits | (uint8_t)reading << 2);
        frame->held_bits = reading >> 6;
        break;
    case 2:
        pack_byte(frame, frame->held_bits | (uint8_t)reading << 4);
        frame->held_bits = reading >> 4;
        break;
    default:
        pack_byte(frame, frame->held_bits | (uint8_t)reading << 6);
        pack_byte(frame, reading >> 2);
        frame->phase = 0;
    }
}

static inline __attribute__((always_inline)) void open_frame(packer *frame) {
    frame->at = buffers[filling];
    frame->crc = 0xffffffffUL;
    pack_byte(frame, 0xa5);
    pack_byte(frame, 0x5a);
    pack_byte(frame, PROTOCOL_VERSION << 4 | READINGS);
    pack_number(frame, sequence++);
    pack_number(frame, began_us);
}

static inline __attribute__((always_inline)) void close_frame(packer *frame) {
    if (frame->phase) pack_byte(frame, frame->held_bits);
    send_filled(put(frame->at, ~frame->crc, CRC_BYTES));
}

/* Reads every state. Running freely, the first conversion of the next frame is left under way. */
static void read_frame(void) {
    packer frame = {0};
    if (!is_converting) begin_frame();
    open_frame(&frame);
    for (bool ends_frame = false; !ends_frame;) {
        bool is_chained;
        change to_next;
        uint16_t reading;
        ends_frame = lit == DARK;
        is_chained = ends_frame && !interval_us;
        to_next = change_to(is_chained ? FIRST : ends_frame ? DARK : lit + 1);
        clock_us();
        for (const uint8_t *next = channel_mux + 1; next < channel_mux + N_RECEIVERS; next++) {
            uint8_t mux = *next;
            wait_for_conversion();
            reading = ADC;
            select_input(mux);
            start_conversion();
            pack_reading(&frame, reading);
        }
        wait_until_held();
        if (SWITCH_EARLY) make(to_next);
        wait_for_conversion();
        if (!SWITCH_EARLY) make(to_next);
        reading = ADC;
        is_converting = false;
        if (is_chained) {
            begin_frame();
        } else if (!ends_frame) {
            select_input(channel_mux[0]);
            wait_until_settled();
            start_conversion();
        }
        pack_reading(&frame, reading);
    }
    close_frame(&frame);
}

/* Whether the next frame's time has come; counts it as late if it had come before the last frame was finished. */
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

/* ---- what the host hears besides frames */

static void say_hello(void) {
    uint8_t *at = put_head(buffers[filling], HELLO);
    *at++ = FIRMWARE_MAJOR;
    *at++ = FIRMWARE_MINOR;
    memcpy_P(at, config_block, HELLO_CONFIG_BYTES);
    put(at + INTERVAL_AT, interval_us, 4);
    send_message(at + HELLO_CONFIG_BYTES);
    said_hello_us = clock_us();
}

static uint16_t reference_reading(void) {
    uint32_t since_us = clock_us();
    uint16_t reading;
    ADCSRB = 0;
    ADMUX = _BV(REFS0) | REFERENCE_MUX;
    do {
        start_conversion();
        wait_for_conversion();
        reading = ADC;
    } while (clock_us() - since_us < REFERENCE_US);
    return reading;
}

extern uint8_t __heap_start;

static void paint_free_ram(void) {
    for (volatile uint8_t *at = &__heap_start; at < (volatile uint8_t *)(SP - 16); at++) *at = FRESH_RAM;
}

static uint16_t least_free_ram(void) {
    const volatile uint8_t *at = &__heap_start;
    while (at < (const volatile uint8_t *)SP && *at == FRESH_RAM) at++;
    return at - &__heap_start;
}

static void test_oneself(void) {
    uint8_t *at = put_head(buffers[filling], SELF_TEST);
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
    if (is_converting) drop_conversion();
    if (order == START && !is_running) {
        is_running = true;
        restart_interval();
    } else if (order == STOP) {
        is_running = false;
        said_hello_us = clock_us();
    } else if (order == RATE && argument <= LONGEST_INTERVAL_US) {
        interval_us = argument;
        restart_interval();
    } else if (order == IDENTIFY) {
        say_hello();
    } else if (order == TEST) {
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

/* Drops the first byte of what was taken for a command, and all up to the next one that may begin one. */
static void look_further(void) {
    uint8_t from = 1, kept = 0;
    while (from < command_length && command[from] != COMMAND_MAGIC_1) from++;
    while (from < command_length) command[kept++] = command[from++];
    command_length = kept;
}

/* Takes at most what the ring can hold, so that a host that never stops talking stops no frame. */
static void listen(void) {
    for (uint8_t left = HEARD_BYTES; left && has_heard(); left--) {
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

/* ---- the two calls */

void core_init(void) {
    cli();
    clock_init();
    line_init();
    for (uint8_t i = 0; i < N_EMITTERS; i++) {
        *emitters[i].port &= ~emitters[i].mask;
        *emitters[i].direction |= emitters[i].mask;
    }
    for (uint8_t i = 0; i < N_RECEIVERS; i++) {
        if (channel_mux[i] < 8) DIDR0 |= _BV(channel_mux[i]);
#if ANY_MUX5
        if (channel_mux[i] >= 32) DIDR2 |= _BV(channel_mux[i] - 32);
#endif
    }
    select_input(channel_mux[0]);
    start_conversion(); /* the first one is longer than the others */
    wait_for_conversion();
    paint_free_ram();
    sei();
    say_hello();
}

void core_step(void) {
    listen();
    if (is_running) {
        if (frame_is_due()) read_frame();
    } else if (clock_us() - said_hello_us >= HELLO_INTERVAL_US) {
        say_hello();
    }
}
