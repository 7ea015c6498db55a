/* Firmware of an optopad sensor on a board with an Arduino core other than the AVR's. It has the same frames and
   messages as core.c, and uses only micros, analogRead, digitalWrite, Serial and, if a design has converters or LED
   drivers, SPI. All settings of a design are in config.h, the messages are in session.h, and the commands of chips on
   the SPI bus are in converter.h and led_driver.h.

   A state is read no sooner than SETTLE_US after its emitter was switched; a value is the mean of AVERAGES readings. A
   message that does not fit into Serial waits in its buffer, and is passed on while emitters settle. While both buffers
   wait for the host, no frame begins and no emitter is lit.

   The reference's reading and the free RAM are not measured, and are sent as 0. */
#include <Arduino.h>

#include "config.h"
#include "core.h"
#include "session.h"

#if CONVERTERS || DRIVER_OUTPUTS
#include <SPI.h>
#endif
#if ADC_BITS < 8 || ADC_BITS > 16
#error "readings are packed for a converter of 8 to 16 bits"
#endif
#define FULL_SCALE ((1UL << ADC_BITS) - 1)

#if SHIFT_BITS
static const uint8_t shift_pins[] = {SHIFT_PINS};
enum shift_line { DATA, CLOCK, LATCH };
#elif !DRIVER_OUTPUTS
static const uint8_t emitter_pins[N_EMITTERS] = {EMITTER_PINS};
#endif
#if CONVERTERS
static const uint8_t select_pins[CONVERTERS] = {SELECT_PINS};
static const uint8_t channel_chips[N_RECEIVERS] = {CHANNEL_NUMBERS};
#else
static const uint16_t channel_pins[N_RECEIVERS] = {CHANNEL_PINS};
#endif
#if ADDRESS_BITS
static const uint8_t address_pins[ADDRESS_BITS] = {ADDRESS_PINS};
#endif
#if ADDRESS_BITS || CONVERTERS
static const uint8_t channel_addresses[N_RECEIVERS] = {CHANNEL_ADDRESSES};
#endif

static const uint8_t *sending, *sending_end;
static uint8_t *filled_end; /* end of the filled buffer, which waits until the other one is sent */
static bool tells_room;

static uint32_t clock_us(void) { return micros(); }

/* ---- the line */

/* Passes on the bytes that Serial has room for. A core that never reports room gets all bytes, and may wait for the
   host. */
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
/* A fast chip switches pins faster than a 74HC595 at 3.3 V can follow. */
static void put(shift_line line, bool is_high) {
    digitalWrite(shift_pins[line], is_high ? HIGH : LOW);
    delayMicroseconds(1);
}

static void pulse(shift_line line) {
    put(line, true);
    put(line, false);
}

/* A single set bit moves along the chain of shift registers, and at the end out of it. After any other dark state the
   bit is shifted in again. */
static void light(uint8_t emitter) {
    static uint8_t lit = N_EMITTERS;
    bool moves = emitter == lit + 1;
    uint16_t zeros = moves ? 1 : emitter == N_EMITTERS ? SHIFT_BITS : emitter;
    if (!moves && emitter != N_EMITTERS) {
        put(DATA, true);
        pulse(CLOCK);
    }
    for (put(DATA, false); zeros; zeros--) pulse(CLOCK);
    pulse(LATCH);
    lit = emitter;
}
#elif DRIVER_OUTPUTS
#include "led_driver.h" /* light and start_drivers, for the commands of these LED drivers */
#else
static void light(uint8_t emitter) {
    static uint8_t lit = N_EMITTERS;
    if (lit < N_EMITTERS) digitalWrite(emitter_pins[lit], LOW);
    if (emitter < N_EMITTERS) digitalWrite(emitter_pins[emitter], HIGH);
    lit = emitter;
}
#endif

static void settle_for(uint32_t wait_us) {
    uint32_t switched_us = clock_us();
    do pump();
    while (clock_us() - switched_us <= wait_us);
}

/* Receivers with the same address are consecutive. After a change of address, the multiplexers need time to settle. */
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

#if CONVERTERS
/* One SPI transfer with a converter, while its chip select is low. The received bytes replace the sent ones. */
static void exchange(uint8_t chip, uint8_t *bytes, uint8_t count) {
    SPI.beginTransaction(SPISettings(CONVERTER_HZ, MSBFIRST, CONVERTER_MODE));
    digitalWrite(select_pins[chip], LOW);
    SPI.transfer(bytes, count);
    digitalWrite(select_pins[chip], HIGH);
    SPI.endTransaction();
    delayMicroseconds(CONVERTER_GAP_US);
}

#include "converter.h" /* reading_of and start_converters, for the commands of these converters */
#else
/* An error of the Arduino core, -1, becomes a reading at full scale. */
static uint16_t reading_of(uint8_t receiver, bool) { return analogRead(channel_pins[receiver]) & FULL_SCALE; }
#endif

static uint16_t value_of(uint8_t receiver) {
    uint32_t sum = AVERAGES / 2;
    for (uint16_t i = 1; i <= AVERAGES; i++) sum += reading_of(receiver, i == AVERAGES);
    return sum / AVERAGES;
}

static void read_frame(void) {
    message frame{};
    uint32_t held = 0;
    uint8_t held_bits = 0;
    for (uint16_t state = 0; state < N_STATES; state++) {
        light(!DARK_AROUND_EACH ? state : state % 2 ? state / 2 : N_EMITTERS);
        settle_for(SETTLE_US);
        if (!state) open_frame(&frame, clock_us());
        for (uint8_t j = 0; j < N_RECEIVERS; j++) {
            select(j);
            held |= (uint32_t)value_of(j) << held_bits;
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
#elif DRIVER_OUTPUTS
    start_drivers();
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
#if CONVERTERS
    for (uint8_t pin : select_pins) {
        pinMode(pin, OUTPUT);
        digitalWrite(pin, HIGH);
    }
#endif
#if CONVERTERS || DRIVER_OUTPUTS
    SPI.begin();
#endif
#if DRIVER_OUTPUTS
    light(N_EMITTERS);
#endif
#if CONVERTERS
    start_converters();
#else
    analogReadResolution(ADC_BITS);
#ifdef CORE_TEENSY
    analogReadAveraging(1); /* by default this core takes the mean of four readings */
#endif
    analogRead(channel_pins[0]); /* the first one may be longer than the others */
#endif
    say_hello();
}

void core_step(void) { step(); }
