/* A simulated AVR board (libsimavr) around compiled firmware: emitters, receivers and serial line; see scene.h.

   usage: simulated_board FIRMWARE.elf SCENE LOG MICROSECONDS [pty]

   A conversion waits for the next edge of the converter's clock, if the scene says so; some clocks later its input is
   held, and rounded to whole millivolts. The simulator would take the voltage when the program reads the result, so the
   held one is handed to it. It has inputs 0 to 7; those above are converted here, by the same rule.
   With `pty` it also serves the line on a pseudo-terminal, whose name it prints, no faster than real time, until the
   time is over or its standard input ends. */
#define _GNU_SOURCE
#include "scene.h"

#include <simavr/avr_adc.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_irq.h>

#define SIMULATED_INPUTS 8
#define CONVERSION_ADC_CLOCKS 13
#define FULL_SCALE 1023

/* Data addresses and bits, the same on all chips of the family. */
enum { ADCL_AT = 0x78, ADCH_AT = 0x79, ADCSRA_AT = 0x7a, ADCSRB_AT = 0x7b, ADMUX_AT = 0x7c };
enum { ADSC_BIT = 0x40, MUX5_BIT = 0x08, MUX_BITS = 0x1f, PRESCALER_BITS = 0x07 };

typedef struct {
    avr_io_read_t read;
    void *converter;
} result_reader;

static avr_t *avr;
static int held_mux, held_mv, is_stretched;
static avr_cycle_count_t conversion_end;
static result_reader low_result, high_result;

static double us_of(avr_cycle_count_t cycles) { return cycles / clock_hz * 1e6; }

static void address_switched(struct avr_irq_t *irq, uint32_t value, void *line) {
    (void)irq;
    select_address((int)((char *)line - address_port), value != 0, avr->cycle / clock_hz * 1e6);
}

static void shift_switched(struct avr_irq_t *irq, uint32_t value, void *line) {
    (void)irq;
    shift_line((int)((char *)line - shift_port), value != 0);
}

static void set_emitter(emitter *e, int on) {
    if (e->on == on) return;
    follow(us_of(avr->cycle));
    e->on = on;
    record(avr->cycle, EMITTER_SWITCHED, (int)(e - emitters) * 2 + on, 0);
}

static void emitter_switched(struct avr_irq_t *irq, uint32_t value, void *which) {
    (void)irq;
    set_emitter(which, value & 1);
}

static avr_cycle_count_t input_held(avr_t *self, avr_cycle_count_t when, void *unused) {
    (void)self, (void)when, (void)unused;
    held_mv = voltage_of(held_mux, us_of(avr->cycle));
    if (held_mux < SIMULATED_INPUTS)
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + held_mux), held_mv);
    record(avr->cycle, INPUT_HELD, held_mux + 256 * lit_emitter(), held_mv);
    return 0;
}

static void conversion_started(struct avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)value, (void)unused;
    avr_cycle_count_t adc_clock = 1 << (avr->data[ADCSRA_AT] & PRESCALER_BITS);
    avr_cycle_count_t wait = waits_for_edges ? (adc_clock - avr->cycle % adc_clock) % adc_clock : 0;
    held_mux = (avr->data[ADMUX_AT] & MUX_BITS) | (avr->data[ADCSRB_AT] & MUX5_BIT ? 32 : 0);
    conversion_end = avr->cycle + wait + CONVERSION_ADC_CLOCKS * adc_clock;
    avr_cycle_timer_register(avr, wait + (avr_cycle_count_t)(hold_adc_clocks * adc_clock), input_held, NULL);
}

/* The simulator ends a conversion 13 clocks after its start; the program sees its end later by the wait for the edge. */
static uint8_t read_control(avr_t *self, avr_io_addr_t address, void *unused) {
    uint8_t found = self->data[address];
    (void)unused;
    if (self->cycle < conversion_end && !(found & ADSC_BIT)) is_stretched = 1;
    if (!is_stretched) return found;
    is_stretched = self->cycle < conversion_end;
    return is_stretched ? found | ADSC_BIT : found & ~ADSC_BIT;
}

/* Of an input that the simulator lacks, the result is made here; of the others it is the simulator's own. */
static uint8_t read_result(avr_t *self, avr_io_addr_t address, void *simulated) {
    const result_reader *reader = simulated;
    int counts = held_mv * FULL_SCALE / (int)supply_mv;
    if (held_mux < 32) return reader->read ? reader->read(self, address, reader->converter) : self->data[address];
    return address == ADCH_AT ? counts >> 8 : counts & 255;
}

static void stand_before(result_reader *reader, avr_io_addr_t address) {
    avr_io_addr_t place = AVR_DATA_TO_IO(address);
    reader->read = avr->io[place].r.c;
    reader->converter = avr->io[place].r.param;
    avr->io[place].r.c = read_result;
    avr->io[place].r.param = reader;
}

static void connect_converter(void) {
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER), conversion_started, NULL);
    avr_register_io_read(avr, ADCSRA_AT, read_control, NULL);
    stand_before(&low_result, ADCL_AT);
    stand_before(&high_result, ADCH_AT);
}

static void byte_sent(struct avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)unused;
    uint8_t byte = value;
    record(avr->cycle, BYTE_SENT, byte, 0);
    if (terminal >= 0 && write(terminal, &byte, 1) < 0) { /* nobody reads: the byte is lost, as on a real line */
    }
}

static void hear(uint8_t byte) {
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte);
}

/* One byte a call, at the line's pace. */
static avr_cycle_count_t say(avr_t *self, avr_cycle_count_t when, void *unused) {
    (void)self, (void)unused;
    speech *s = &speeches[current_speech];
    hear(s->bytes[s->next++]);
    if (s->next < s->count) return when + (avr_cycle_count_t)(clock_hz / baud * BITS_PER_BYTE);
    if (++current_speech == speech_count) return 0;
    avr_cycle_count_t at = speeches[current_speech].at_us * clock_hz / 1e6;
    return at > when ? at : when + (avr_cycle_count_t)(clock_hz / baud * BITS_PER_BYTE);
}

/* Bytes from the terminal go on at the line's pace; an empty terminal is looked at once in a millisecond. */
static avr_cycle_count_t listen_to_terminal(avr_t *self, avr_cycle_count_t when, void *unused) {
    static uint8_t waiting[MOST];
    static ssize_t count, next;
    (void)self, (void)unused;
    if (next >= count) {
        next = 0;
        count = read(terminal, waiting, sizeof waiting);
        if (count <= 0) return when + (avr_cycle_count_t)(clock_hz / 1000);
    }
    hear(waiting[next++]);
    return when + (avr_cycle_count_t)(clock_hz / baud * BITS_PER_BYTE);
}

static void load(const char *name) {
    elf_firmware_t firmware = {0};
    if (elf_read_firmware(name, &firmware)) refuse("no firmware", name);
    if (!(avr = avr_make_mcu_by_name(mcu))) refuse("no such chip", mcu);
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    avr->frequency = clock_hz;
    avr->vcc = avr->avcc = avr->aref = supply_mv;
    avr->log = LOG_ERROR;
}

static void connect_parts(void) {
    uint32_t flags = 0; /* no echo on standard output, no sleeping while the program polls */
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    for (int i = 0; i < address_count; i++) {
        avr_irq_t *pin = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(address_port[i]), address_bit[i]);
        avr_irq_register_notify(pin, address_switched, &address_port[i]);
    }
    for (int i = 0; i < shift_count; i++) {
        avr_irq_t *pin = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(shift_port[i]), shift_bit[i]);
        avr_irq_register_notify(pin, shift_switched, &shift_port[i]);
    }
    for (int i = 0; i < emitter_count; i++) {
        emitter *e = &emitters[i];
        if (e->port == 'Q') continue;
        avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(e->port), e->bit), emitter_switched, e);
    }
    connect_converter();
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), byte_sent, NULL);
    if (speech_count) avr_cycle_timer_register_usec(avr, speeches[0].at_us, say, NULL);
}

static int is_over(double start_s) {
    double ahead_s = us_of(avr->cycle) / 1e6 - (monotonic_s() - start_s);
    if (ahead_s > 0) usleep(ahead_s * 1e6);
    return is_left_alone();
}

int main(int count, char **arguments) {
    if (count < 5) refuse("usage", "simulated_board FIRMWARE.elf SCENE LOG MICROSECONDS [pty]");
    take_scene(arguments[2]);
    load(arguments[1]);
    if (!(log_file = fopen(arguments[3], "wb"))) refuse("cannot be written", arguments[3]);
    connect_parts();
    if (count > 5) {
        open_terminal();
        avr_cycle_timer_register_usec(avr, 1000, listen_to_terminal, NULL);
    }
    double start_s = monotonic_s();
    avr_cycle_count_t end = atof(arguments[4]) * clock_hz / 1e6, next_look = 0;
    while (avr->cycle < end) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) refuse("the program stopped", arguments[1]);
        if (terminal < 0 || avr->cycle < next_look) continue;
        next_look = avr->cycle + (avr_cycle_count_t)(clock_hz / 500);
        if (is_over(start_s)) break;
    }
    fclose(log_file);
    return 0;
}
