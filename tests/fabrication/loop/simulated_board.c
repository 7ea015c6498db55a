/* A simulated AVR board (libsimavr) around compiled firmware: emitters, receivers and serial line.

   usage: simulated_board FIRMWARE.elf SCENE LOG MICROSECONDS [pty]

   Every emitter's light follows its pin with one time constant, and the amplifiers follow the light with another; a
   receiver's voltage is its dark one plus, for each emitter, that emitter's share of light times what the table says.
   A conversion waits for the next edge of the converter's clock, if the scene says so; some clocks later its input is
   held, and rounded to whole millivolts. The simulator would take the voltage when the program reads the result, so the
   held one is handed to it. It has inputs 0 to 7; those above are converted here, by the same rule.

   Scene, one item a line: mcu NAME | clock HZ | supply MV | baud N | light_tau_us T | amplifier_tau_us T |
   edges 0|1 | hold_adc_clocks N | emitter PORT BIT MV ... (one a receiver) | dark MV ... | receiver MUX | say AT_US HEX
   Log: 16-byte records, little-endian: cycle u64, kind u16 (0 byte sent, 1 input held, 2 emitter switched), number u16
   (byte; MUX + 256 x lowest lit emitter, or their count if none is; 2 x emitter + on), millivolts i32.
   With `pty` it also serves the line on a pseudo-terminal, whose name it prints, no faster than real time, until the
   time is over or its standard input ends.

   Left out: noise, the supply's step when an emitter switches, crosstalk between inputs. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pty.h>
#include <simavr/avr_adc.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_irq.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define MOST 64
#define MOST_SAID 256
#define BITS_PER_BYTE 10
#define SIMULATED_INPUTS 8
#define CONVERSION_ADC_CLOCKS 13
#define FULL_SCALE 1023

/* Data addresses and bits, the same on all chips of the family. */
enum { ADCL_AT = 0x78, ADCH_AT = 0x79, ADCSRA_AT = 0x7a, ADCSRB_AT = 0x7b, ADMUX_AT = 0x7c };
enum { ADSC_BIT = 0x40, MUX5_BIT = 0x08, MUX_BITS = 0x1f, PRESCALER_BITS = 0x07 };

enum record_kind { BYTE_SENT, INPUT_HELD, EMITTER_SWITCHED };

typedef struct {
    char port;
    int bit, on;
    double light, amplified, millivolts[MOST];
} emitter;

typedef struct {
    double at_us;
    uint8_t bytes[MOST];
    int count, next;
} speech;

typedef struct {
    avr_io_read_t read;
    void *converter;
} result_reader;

static avr_t *avr;
static emitter emitters[MOST];
static speech speeches[MOST_SAID];
static int emitter_count, receiver_count, dark_count, speech_count, current_speech, terminal = -1;
static int receiver_mux[MOST], held_mux, held_mv, waits_for_edges, is_stretched;
static double dark_mv[MOST], light_tau_us, amplifier_tau_us, hold_adc_clocks = 1.5;
static double clock_hz, supply_mv, baud;
static char mcu[32];
static FILE *log_file;
static avr_cycle_count_t followed_cycle, conversion_end;
static result_reader low_result, high_result;

static void refuse(const char *what, const char *about) {
    fprintf(stderr, "simulated_board: %s: %s\n", what, about);
    exit(2);
}

static double us_of(avr_cycle_count_t cycles) { return cycles / clock_hz * 1e6; }

static void record(enum record_kind kind, int number, int millivolts) {
    uint64_t cycle = avr->cycle;
    uint16_t words[2] = {kind, number};
    int32_t value = millivolts;
    fwrite(&cycle, 8, 1, log_file);
    fwrite(words, 4, 1, log_file);
    fwrite(&value, 4, 1, log_file);
}

/* Light and amplifier are two first-order lags in a row; between switches the solution is closed. */
static void follow(void) {
    double t = us_of(avr->cycle - followed_cycle);
    double fast = exp(-t / light_tau_us), slow = exp(-t / amplifier_tau_us);
    double share = light_tau_us / (light_tau_us - amplifier_tau_us);
    for (int i = 0; i < emitter_count; i++) {
        emitter *e = &emitters[i];
        double off = e->light - e->on;
        e->amplified = e->on + off * share * (fast - slow) + (e->amplified - e->on) * slow;
        e->light = e->on + off * fast;
    }
    followed_cycle = avr->cycle;
}

static void emitter_switched(struct avr_irq_t *irq, uint32_t value, void *which) {
    emitter *e = which;
    (void)irq;
    if (e->on == (int)(value & 1)) return;
    follow();
    e->on = value & 1;
    record(EMITTER_SWITCHED, (int)(e - emitters) * 2 + e->on, 0);
}

static int lit_emitter(void) {
    int i = 0;
    while (i < emitter_count && !emitters[i].on) i++;
    return i;
}

static avr_cycle_count_t input_held(avr_t *self, avr_cycle_count_t when, void *unused) {
    (void)self, (void)when, (void)unused;
    follow();
    held_mv = 0;
    for (int r = 0; r < receiver_count; r++) {
        if (receiver_mux[r] != held_mux) continue;
        double sum = dark_mv[r];
        for (int i = 0; i < emitter_count; i++) sum += emitters[i].amplified * (emitters[i].millivolts[r] - dark_mv[r]);
        held_mv = (int)lround(fmax(sum, 0.0));
    }
    if (held_mux < SIMULATED_INPUTS)
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + held_mux), held_mv);
    record(INPUT_HELD, held_mux + 256 * lit_emitter(), held_mv);
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
    record(BYTE_SENT, byte, 0);
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

static int numbers(char *text, double *into) {
    int count = 0;
    for (char *word = strtok(text, " \n"); word && count < MOST; word = strtok(NULL, " \n")) into[count++] = atof(word);
    return count;
}

static void take_speech(char *text) {
    speech *s = &speeches[speech_count++];
    char hex[2 * MOST + 1];
    if (speech_count > MOST_SAID || sscanf(text, "%lf %128s", &s->at_us, hex) != 2) refuse("cannot be said", text);
    for (unsigned value; s->count < (int)strlen(hex) / 2; s->bytes[s->count++] = value)
        if (sscanf(hex + 2 * s->count, "%2x", &value) != 1) refuse("no hexadecimal digits", hex);
}

static void take_line(char *line) {
    char *rest = strchr(line, ' ');
    if (!rest) refuse("no value", line);
    *rest++ = 0;
    if (!strcmp(line, "mcu")) sscanf(rest, "%31s", mcu);
    else if (!strcmp(line, "clock")) clock_hz = atof(rest);
    else if (!strcmp(line, "supply")) supply_mv = atof(rest);
    else if (!strcmp(line, "baud")) baud = atof(rest);
    else if (!strcmp(line, "light_tau_us")) light_tau_us = atof(rest);
    else if (!strcmp(line, "amplifier_tau_us")) amplifier_tau_us = atof(rest);
    else if (!strcmp(line, "edges")) waits_for_edges = atoi(rest);
    else if (!strcmp(line, "hold_adc_clocks")) hold_adc_clocks = atof(rest);
    else if (!strcmp(line, "dark")) dark_count = numbers(rest, dark_mv);
    else if (!strcmp(line, "receiver") && receiver_count < MOST) receiver_mux[receiver_count++] = atoi(rest);
    else if (!strcmp(line, "say")) take_speech(rest);
    else if (!strcmp(line, "emitter") && emitter_count < MOST) {
        emitter *e = &emitters[emitter_count++];
        e->port = rest[0];
        e->bit = rest[2] - '0';
        numbers(rest + 4, e->millivolts);
    } else refuse("unknown line", line);
}

static void take_scene(const char *name) {
    FILE *file = fopen(name, "r");
    char line[4096];
    if (!file) refuse("no such scene", name);
    while (fgets(line, sizeof line, file)) take_line(line);
    fclose(file);
    if (!emitter_count || dark_count != receiver_count || light_tau_us == amplifier_tau_us) refuse("incomplete", name);
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
    for (int i = 0; i < emitter_count; i++) {
        emitter *e = &emitters[i];
        avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(e->port), e->bit), emitter_switched, e);
    }
    connect_converter();
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), byte_sent, NULL);
    if (speech_count) avr_cycle_timer_register_usec(avr, speeches[0].at_us, say, NULL);
}

static void open_terminal(void) {
    int other;
    char name[64];
    struct termios raw;
    if (openpty(&terminal, &other, name, NULL, NULL)) refuse("no pseudo-terminal", "openpty");
    tcgetattr(other, &raw);
    cfmakeraw(&raw);
    tcsetattr(other, TCSANOW, &raw);
    fcntl(terminal, F_SETFL, O_NONBLOCK);
    printf("%s\n", name);
    fflush(stdout);
    avr_cycle_timer_register_usec(avr, 1000, listen_to_terminal, NULL);
}

static int is_over(double start_s) {
    struct timespec now;
    struct pollfd input = {.fd = 0, .events = POLLIN};
    char byte;
    clock_gettime(CLOCK_MONOTONIC, &now);
    double ahead_s = us_of(avr->cycle) / 1e6 - (now.tv_sec + now.tv_nsec / 1e9 - start_s);
    if (ahead_s > 0) usleep(ahead_s * 1e6);
    fflush(log_file);
    return poll(&input, 1, 0) > 0 && read(0, &byte, 1) <= 0;
}

int main(int count, char **arguments) {
    if (count < 5) refuse("usage", "simulated_board FIRMWARE.elf SCENE LOG MICROSECONDS [pty]");
    take_scene(arguments[2]);
    load(arguments[1]);
    if (!(log_file = fopen(arguments[3], "wb"))) refuse("cannot be written", arguments[3]);
    connect_parts();
    if (count > 5) open_terminal();
    struct timespec start;
    clock_gettime(CLOCK_MONOTONIC, &start);
    avr_cycle_count_t end = atof(arguments[4]) * clock_hz / 1e6, next_look = 0;
    while (avr->cycle < end) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) refuse("the program stopped", arguments[1]);
        if (terminal < 0 || avr->cycle < next_look) continue;
        next_look = avr->cycle + (avr_cycle_count_t)(clock_hz / 500);
        if (is_over(start.tv_sec + start.tv_nsec / 1e9)) break;
    }
    fclose(log_file);
    return 0;
}
