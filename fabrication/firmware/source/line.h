/* The serial line: one buffer is sent by interrupts while the other is filled; received bytes wait in a ring. */
#ifndef OPTOPAD_LINE_H
#define OPTOPAD_LINE_H
#include "clock.h"
#include "session.h"

#include <avr/interrupt.h>

static uint8_t *volatile sending;
static uint8_t *volatile sending_end;

static volatile uint8_t heard[HEARD_BYTES];
static volatile uint8_t heard_start, heard_end;

static void line_init(void) {
    UCSR0A = _BV(U2X0);
    UBRR0 = BAUD_DIVISOR - 1;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

/* The interrupt runs for every byte, one per 10 us at 1 Mbaud, and may take 3 us. It is in assembler, because the
   compiler's version takes twice the time. It does UDR0 = *sending++ and, after the last byte,
   UCSR0B &= ~_BV(UDRIE0). */
ISR(TRANSMIT_VECTOR, ISR_NAKED) {
    __asm__ volatile("push r24\n\t"
                     "in r24, __SREG__\n\t"
                     "push r24\n\t"
                     "push r30\n\t"
                     "push r31\n\t"
                     "lds r30, %[at]\n\t"
                     "lds r31, %[at] + 1\n\t"
                     "ld r24, Z+\n\t"
                     "sts %[data], r24\n\t"
                     "sts %[at] + 1, r31\n\t"
                     "sts %[at], r30\n\t"
                     "lds r24, %[end]\n\t"
                     "cp r30, r24\n\t"
                     "lds r24, %[end] + 1\n\t"
                     "cpc r31, r24\n\t"
                     "brne 1f\n\t"
                     "lds r24, %[control]\n\t"
                     "andi r24, %[others]\n\t"
                     "sts %[control], r24\n"
                     "1:\tpop r31\n\t"
                     "pop r30\n\t"
                     "pop r24\n\t"
                     "out __SREG__, r24\n\t"
                     "pop r24\n\t"
                     "reti"
                     :
                     : [at] "i"(&sending), [end] "i"(&sending_end), [data] "i"(_SFR_MEM_ADDR(UDR0)),
                       [control] "i"(_SFR_MEM_ADDR(UCSR0B)), [others] "i"((uint8_t)~_BV(UDRIE0)));
}

ISR(RECEIVE_VECTOR) {
    uint8_t byte = UDR0, next = (heard_end + 1) & (HEARD_BYTES - 1);
    if (next == heard_start) return; /* no room: the byte is lost, which the command's checksum detects */
    heard[heard_end] = byte;
    heard_end = next;
}

/* Waits until the line is free, then passes the filled buffer to it. */
static void send_filled(uint8_t *end) {
    while (UCSR0B & _BV(UDRIE0)) clock_us();
    sending = buffers[filling];
    sending_end = end;
    __asm__ volatile("" ::: "memory"); /* all bytes must be in memory before the interrupt reads the buffer */
    UCSR0B |= _BV(UDRIE0);
    filling ^= 1;
}

static inline bool can_fill(void) { return true; } /* send_filled waits for the line */

static inline bool has_heard(void) { return heard_start != heard_end; }

static uint8_t next_heard(void) {
    uint8_t byte = heard[heard_start];
    heard_start = (heard_start + 1) & (HEARD_BYTES - 1);
    return byte;
}
#endif
