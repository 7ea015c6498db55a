/* Firmware of an optopad sensor on a board with an Arduino core other than the AVR's: the same frames and messages as
   core.c, by micros, analogRead, digitalWrite and Serial only. All settings of a design are in config.h, the messages
   are in session.h.

   A state is read no sooner than SETTLE_US after its emitter was switched; a value is the mean of AVERAGES readings. A
   message without room in Serial waits in its buffer, and is passed on while emitters settle. While both buffers
   wait for the host, no frame begins and no emitter is lit.

   The reading of a reference and the free RAM are not measured, and sent as 0. */
#include <Arduino.h>

#include "config.h"
#include "core.h"
#include "session.h"

#if ADC_BITS < 8 || ADC_BITS > 16
#error "readings are packed for a converter of 8 to 16 bits"
#endif
#define FULL_SCALE ((1UL << ADC_BITS) - 1)

#if SHIFT_BITS
static const uint8_t shift_pins[] = {SHIFT_PINS};
enum shift_line { DATA, CLOCK, LATCH };
#else
static const uint8_t emitter_pins[N_EMITTERS] = {EMITTER_PINS};
#endif
static const uint16_t channel_pins[N_RECEIVERS] = {CHANNEL_PINS};
#if ADDRESS_BITS
static const uint8_t address_pins[ADDRESS_BITS] = {ADDRESS_PINS};
static const uint8_t channel_addresses[N_RECEIVERS] = {CHANNEL_ADDRESSES};
#endif

static const uint8_t *sending, *sending_end;
static uint8_t *filled_end; /* end of the buffer that waits for the one being sent */
static bool tells_room;

static uint32_t clock_us(void) { return micros(); }

/* ---- the line */

/* Passes on the bytes that Serial has room for. A core that never reports room gets all, and may wait for the host. */
static void pump(void) {
    for (size_t taken = 1; taken;) {
        if (sending == sending_end) {
            if (!filled_end) return;
            sending = buffers[filling];
            sending_end = filled_end;
            filled_end = nullptr;
            filling ^= 1;
        }
        int room = Serial.availableForWrite(), left = sending_end - sending;
        tells_room |= room > 0;
        if (!tells_room || room > left) room = left;
        taken = room ? Serial.write(sending, room) : 0;
        sending += taken;
    }
}

static void send_filled(uint8_t *end) {
    filled_end = end;
    pump();
}

static bool can_fill(void) {
    pump();
    return !filled_end;
}

static bool has_heard(void) { return Serial.available() > 0; }

static uint8_t next_heard(void) { return Serial.read(); }

/* ---- a frame */

static void drop_frame(void) {} /* none is in progress between frames */

#if SHIFT_BITS
/* A fast chip's edges follow one another sooner than a 74HC595 at 3.3 V bears. */
static void put(shift_line line, bool is_high) {
    digitalWrite(shift_pins[line], is_high ? HIGH : LOW);
    delayMicroseconds(1);
}

static void pulse(shift_line line) {
    put(line, true);
    put(line, false);
}

/* Lights the emitter of a state, whose neighbour was lit: a single bit moves along the chain and out of it. */
static void light(uint8_t state) {
    put(DATA, !state);
    pulse(CLOCK);
    pulse(LATCH);
}
#else
static void light(uint8_t state) {
    if (state) digitalWrite(emitter_pins[state - 1], LOW);
    if (state < N_EMITTERS) digitalWrite(emitter_pins[state], HIGH);
}
#endif

static void settle_for(uint32_t wait_us) {
    uint32_t switched_us = clock_us();
    do pump();
    while (clock_us() - switched_us <= wait_us);
}

/* Receivers of one address are consecutive: a new address waits for the multiplexers. */
static void select(uint8_t receiver) {
#if ADDRESS_BITS
    static uint8_t selected = 255;
    if (channel_addresses[receiver] == selected) return;
    selected = channel_addresses[receiver];
    for (uint8_t bit = 0; bit < ADDRESS_BITS; bit++) digitalWrite(address_pins[bit], selected >> bit & 1 ? HIGH : LOW);
    settle_for(ADDRESS_SETTLE_US);
#else
    (void)receiver;
#endif
}

/* A core's error, -1, becomes a reading at full scale. */
static uint16_t value_of(uint16_t pin) {
    uint32_t sum = AVERAGES / 2;
    for (uint16_t i = 0; i < AVERAGES; i++) sum += analogRead(pin) & FULL_SCALE;
    return sum / AVERAGES;
}

static void read_frame(void) {
    message frame{};
    uint32_t held = 0;
    uint8_t held_bits = 0;
    for (uint8_t state = 0; state < N_STATES; state++) {
        light(state);
        settle_for(SETTLE_US);
        if (!state) open_frame(&frame, clock_us());
        for (uint8_t j = 0; j < N_RECEIVERS; j++) {
            select(j);
            held |= (uint32_t)value_of(channel_pins[j]) << held_bits;
            for (held_bits += ADC_BITS; held_bits >= 8; held_bits -= 8, held >>= 8) pack_byte(&frame, held);
        }
    }
    if (held_bits) pack_byte(&frame, held);
    close_frame(&frame);
}

static uint16_t reference_reading(void) { return 0; }

static uint16_t least_free_ram(void) { return 0; }

/* ---- the two calls */

void core_init(void) {
#if SHIFT_BITS
    for (uint8_t pin : shift_pins) {
        pinMode(pin, OUTPUT);
        digitalWrite(pin, LOW);
    }
    for (uint16_t i = 0; i < SHIFT_BITS; i++) pulse(CLOCK);
    pulse(LATCH);
#else
    for (uint8_t pin : emitter_pins) {
        pinMode(pin, OUTPUT);
        digitalWrite(pin, LOW);
    }
#endif
#if ADDRESS_BITS
    for (uint8_t pin : address_pins) pinMode(pin, OUTPUT);
#endif
    Serial.begin(BAUD);
    analogReadResolution(ADC_BITS);
#ifdef CORE_TEENSY
    analogReadAveraging(1); /* its core takes the mean of four readings otherwise */
#endif
    analogRead(channel_pins[0]); /* the first one may be longer than the others */
    say_hello();
}

void core_step(void) { step(); }
