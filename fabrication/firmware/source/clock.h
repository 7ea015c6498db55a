/* Microseconds since reset, wrapping at 32 bits, from timer 1 at an eighth of the processor's clock. The clock must be
   read every 32 ms, or it loses that time. Every long wait or computation therefore reads it. */
#ifndef OPTOPAD_CLOCK_H
#define OPTOPAD_CLOCK_H
#include <avr/io.h>
#include <stdint.h>

#define TICKS_PER_US (CLOCK_HZ / 8000000UL)
#ifndef FIRST_US
#define FIRST_US 0
#endif
static uint32_t epoch_us = FIRST_US;

static void clock_init(void) {
    TIMSK0 = 0; /* the Arduino core's millisecond tick would delay conversions */
    TIMSK1 = 0;
    TCCR1A = 0;
    TCCR1B = _BV(CS11);
}

static uint32_t clock_us(void) {
    uint16_t ticks = TCNT1;
    if (TIFR1 & _BV(TOV1)) {
        TIFR1 = _BV(TOV1);
        epoch_us += 65536UL / TICKS_PER_US;
        ticks = TCNT1;
    }
    return epoch_us + ticks / TICKS_PER_US;
}
#endif
