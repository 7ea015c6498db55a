/* Firmware of an optopad sensor on an AVR board: it lights one emitter after another, then none, reads every receiver
   in each of these states, and sends the readings as binary frames. All settings of a design are in config.h.

   The next conversion is started before the reading of the last one is packed, so packing and checksum cost
   no time. Interrupts send the buffer that is not being filled. A state is read no sooner than
   SETTLE_US after its emitter was switched. Emitters are switched between conversions, so that the step of the supply
   disturbs no conversion. With SWITCH_EARLY they are switched during a state's last conversion, after the converter has
   sampled its input. The messages are in session.h. */
#pragma GCC optimize("O2")

#include "config.h"
#include "core.h"
#include "session.h"

#include <avr/io.h>

#if F_CPU != CLOCK_HZ
#error "the program is compiled for another clock than the design's board has"
#endif
#if CLOCK_HZ % 8000000UL
#error "the microsecond clock needs a whole number of ticks a microsecond: a clock of 8 or 16 MHz"
#endif
#if ADC_BITS != 10
#error "readings are packed for a converter of 10 bits"
#endif

#define REFERENCE_US 2000 /* much longer than the reference and the input, which it drives weakly, take to settle */
#define SETTLE_TICKS (SETTLE_US * TICKS_PER_US + 1)
/* The converter samples its input 1.5 of its clocks after it has begun; it begins at most one clock late. */
#define HOLD_TICKS ((3UL << PRESCALER_EXPONENT) / 8 + 1)
#define FRESH_RAM 0xa7

#include "line.h"

typedef struct {
    volatile uint8_t *port, *direction;
    uint8_t mask;
} emitter_pin;

/* A change from one emitter to the next, whose registers are looked up in advance. */
typedef struct {
    volatile uint8_t *off_port, *on_port;
    uint8_t off_mask, on_mask;
    const emitter_pin *next;
} change;

typedef struct {
    message message;
    uint8_t held_bits, phase;
} packer;

#define LED(letter, bit) {&PORT##letter, &DDR##letter, 1 << (bit)}
#define NO_LED {&GPIOR0, &GPIOR0, 0} /* the dark state switches no pin, only an unused register */
static const emitter_pin emitters[N_EMITTERS + 1] = {EMITTERS, NO_LED};
#define FIRST emitters
#define DARK (emitters + N_EMITTERS)
#define BEGIN (DARK_AROUND_EACH ? DARK : FIRST)
#if SHIFT_BITS
static const emitter_pin shift_lines[] = {SHIFTS};
enum shift_line { DATA, CLOCK, LATCH };
#endif
static const uint8_t channel_mux[N_RECEIVERS] = {CHANNEL_MUX};
#if ADDRESS_BITS
static const emitter_pin address_lines[ADDRESS_BITS] = {ADDRESSES};
static const uint8_t channel_addresses[N_RECEIVERS] = {CHANNEL_ADDRESSES};
#endif

static uint32_t began_us;
static bool is_converting;
static const emitter_pin *lit = DARK;
static uint16_t switched_at;
#if SWITCH_EARLY
static uint8_t started_at;
#endif

/* ---- emitters and converter */

static inline change change_to(const emitter_pin *next) {
    return (change){lit->port, next->port, ~lit->mask, next->mask, next};
}

#if SHIFT_BITS
static void pulse(enum shift_line line) {
    *shift_lines[line].port |= shift_lines[line].mask;
    *shift_lines[line].port &= ~shift_lines[line].mask;
}

/* A single set bit moves along the chain of shift registers, and at the end out of it. Any other change to darkness
   fills the chain with zeros, and any other change to an emitter shifts the bit in again. */
static void shift_to(const emitter_pin *next) {
    const emitter_pin *data = &shift_lines[DATA];
    bool moves = next == lit + 1;
    uint16_t zeros = moves ? 1 : next == DARK ? SHIFT_BITS : next - FIRST;
    if (!moves && next != DARK) {
        *data->port |= data->mask;
        pulse(CLOCK);
    }
    *data->port &= ~data->mask;
    for (; zeros; zeros--) pulse(CLOCK);
    pulse(LATCH);
}
#endif

static inline void make(change now) {
#if SHIFT_BITS
    shift_to(now.next);
#else
    *now.off_port &= now.off_mask;
    *now.on_port |= now.on_mask;
#endif
    switched_at = TCNT1;
    lit = now.next;
}

static inline void select_input(uint8_t mux) {
    ADMUX = FULL_SCALE_BITS | (mux & 31);
#if ANY_MUX5
    ADCSRB = mux & 32 ? _BV(MUX5) : 0;
#endif
}

/* Receivers with the same address are consecutive. After a change of address, the multiplexers need time to settle. */
static inline void select_receiver(uint8_t receiver) {
    select_input(channel_mux[receiver]);
#if ADDRESS_BITS
    static uint8_t selected = 255;
    uint8_t address = channel_addresses[receiver];
    uint16_t selected_at;
    if (address == selected) return;
    selected = address;
    for (uint8_t i = 0; i < ADDRESS_BITS; i++, address >>= 1) {
        if (address & 1) *address_lines[i].port |= address_lines[i].mask;
        else *address_lines[i].port &= ~address_lines[i].mask;
    }
    selected_at = TCNT1;
    while ((uint16_t)(TCNT1 - selected_at) < ADDRESS_SETTLE_US * TICKS_PER_US + 1) {}
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

/* Sum of the readings for one mean value, plus half of AVERAGES for rounding. The last conversion is left in progress,
   and its reading is not in the sum. */
static inline uint32_t most_of_value(void) {
    uint32_t sum = AVERAGES / 2;
    for (uint16_t n = 1; n < AVERAGES; n++) {
        wait_for_conversion();
        sum += ADC;
        start_conversion();
        clock_us(); /* counts the clock's overflows, one every 32 ms */
    }
    return sum;
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
    select_receiver(0);
    if (lit != BEGIN) make(change_to(BEGIN));
    wait_until_settled();
    start_conversion();
    began_us = clock_us();
    is_converting = true;
}

static void drop_frame(void) {
    if (!is_converting) return;
    wait_for_conversion();
    make(change_to(DARK));
    is_converting = false;
}

/* ---- a frame */

/* Appends ten bits to the packed readings, the least significant first. */
static inline __attribute__((always_inline)) void pack_reading(packer *frame, uint16_t reading) {
    switch (frame->phase++) {
    case 0:
        pack_byte(&frame->message, reading);
        frame->held_bits = reading >> 8;
        break;
    case 1:
        pack_byte(&frame->message, frame->held_bits | (uint8_t)reading << 2);
        frame->held_bits = reading >> 6;
        break;
    case 2:
        pack_byte(&frame->message, frame->held_bits | (uint8_t)reading << 4);
        frame->held_bits = reading >> 4;
        break;
    default:
        pack_byte(&frame->message, frame->held_bits | (uint8_t)reading << 6);
        pack_byte(&frame->message, reading >> 2);
        frame->phase = 0;
    }
}

/* Reads every state. If frames follow without a pause, the first conversion of the next frame is left in progress. */
static void read_frame(void) {
    packer frame = {0};
    const emitter_pin *next_lit = FIRST;
    if (!is_converting) begin_frame();
    open_frame(&frame.message, began_us);
    for (bool ends_frame = false; !ends_frame;) {
        bool is_chained;
        change to_next;
        uint32_t sum;
        if (lit != DARK) next_lit++;
        ends_frame = lit == DARK && next_lit == DARK;
        is_chained = ends_frame && !interval_us;
        to_next = change_to(is_chained ? BEGIN : ends_frame || (DARK_AROUND_EACH && lit != DARK) ? DARK : next_lit);
        clock_us();
        for (uint8_t next = 1; next < N_RECEIVERS; next++) {
            sum = most_of_value();
            wait_for_conversion();
            sum += ADC;
            select_receiver(next);
            start_conversion();
            clock_us();
            pack_reading(&frame, sum / AVERAGES);
        }
        sum = most_of_value();
        wait_until_held();
        if (SWITCH_EARLY) make(to_next);
        wait_for_conversion();
        if (!SWITCH_EARLY) make(to_next);
        sum += ADC;
        is_converting = false;
        if (is_chained) {
            begin_frame();
        } else if (!ends_frame) {
            select_receiver(0);
            wait_until_settled();
            start_conversion();
        }
        pack_reading(&frame, sum / AVERAGES);
    }
    if (frame.phase) pack_byte(&frame.message, frame.held_bits);
    close_frame(&frame.message);
}

static uint16_t reference_reading(void) {
    uint32_t since_us = clock_us();
    uint16_t reading;
    if (FULL_SCALE_BITS != _BV(REFS0)) return 0; /* the reference is full scale, so it cannot be measured */
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

/* ---- the two calls */

void core_init(void) {
    cli();
    clock_init();
    line_init();
    for (uint8_t i = 0; i < N_EMITTERS; i++) {
        *emitters[i].port &= ~emitters[i].mask;
        *emitters[i].direction |= emitters[i].mask;
    }
#if ADDRESS_BITS
    for (uint8_t i = 0; i < ADDRESS_BITS; i++) *address_lines[i].direction |= address_lines[i].mask;
#endif
#if SHIFT_BITS
    for (uint8_t i = 0; i < 3; i++) *shift_lines[i].direction |= shift_lines[i].mask;
    shift_to(DARK);
#endif
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

void core_step(void) { step(); }
