/* What the simulated boards have in common: light, the scene that tells of it, the log, and the pseudo-terminal.

   Every emitter's light follows its pin with one time constant, and the amplifiers follow the light with another; a
   receiver's voltage is its dark one plus, for each emitter, that emitter's share of light times what the table says.
   An input has the voltage of its receiver at the address of the multiplexers, and 0 while a new address settles.

   Scene, one item a line: mcu NAME | clock HZ | supply MV | baud N | light_tau_us T | amplifier_tau_us T |
   edges 0|1 | hold_adc_clocks N | emitter PORT BIT MV ... (one a receiver) | dark MV ... | receiver INPUT ADDRESS |
   address PORT BIT (of the multiplexers, lowest first) |
   shift PORT BIT (data, clock, latch of shift registers; an emitter on their output N has PORT Q and BIT N) |
   converter NAME PIN (mcp3208, ads8688 or ads7953, chip select; a receiver's INPUT is its number, and ADDRESS its channel) |
   driver LATCH BLANK OUTPUTS (pins of TLC5947, and how many outputs the chain has; emitters as of shift registers) | say AT_US HEX
   Log: 16-byte records, little-endian: cycle u64, kind u16 (0 byte sent, 1 input held, 2 emitter switched), number u16
   (byte; INPUT + 256 x lowest lit emitter, or their count if none is; 2 x emitter + on), millivolts i32.

   Left out: noise, the supply's step when an emitter switches, crosstalk between inputs. */
#ifndef OPTOPAD_SCENE_H
#define OPTOPAD_SCENE_H
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pty.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define MOST 64
#define MOST_SAID 256
#define BITS_PER_BYTE 10
#define ADDRESS_SETTLES_US 0.5

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

static emitter emitters[MOST];
static speech speeches[MOST_SAID];
static int emitter_count, receiver_count, dark_count, speech_count, current_speech, terminal = -1;
static int receiver_input[MOST], receiver_address[MOST], waits_for_edges;
static int address_bit[8], address_count, selected_address;
static char address_port[8], shift_port[3];
static int shift_bit[3], shift_count, shift_level[3];
static uint64_t shifted;
enum converter_kind { MCP3208, ADS8688, ADS7953, CONVERTER_KINDS };
static const char *const converter_names[] = {"mcp3208", "ads8688", "ads7953"};
static int converter_pin[MOST], converter_kinds[MOST], converter_count;
static int driver_latch, driver_blank, driver_outputs;
static double selected_us;
static double dark_mv[MOST], light_tau_us, amplifier_tau_us, hold_adc_clocks = 1.5, followed_us;
static double clock_hz, supply_mv, baud;
static char mcu[32];
static FILE *log_file;

static void refuse(const char *what, const char *about) {
    fprintf(stderr, "simulated board: %s: %s\n", what, about);
    exit(2);
}

static void record(uint64_t cycle, enum record_kind kind, int number, int millivolts) {
    uint16_t words[2] = {(uint16_t)kind, (uint16_t)number};
    int32_t value = millivolts;
    fwrite(&cycle, 8, 1, log_file);
    fwrite(words, 4, 1, log_file);
    fwrite(&value, 4, 1, log_file);
}

/* Light and amplifier are two first-order lags in a row; between switches the solution is closed. */
static void follow(double now_us) {
    double t = now_us - followed_us;
    double fast = exp(-t / light_tau_us), slow = exp(-t / amplifier_tau_us);
    double share = light_tau_us / (light_tau_us - amplifier_tau_us);
    for (int i = 0; i < emitter_count; i++) {
        emitter *e = &emitters[i];
        double off = e->light - e->on;
        e->amplified = e->on + off * share * (fast - slow) + (e->amplified - e->on) * slow;
        e->light = e->on + off * fast;
    }
    followed_us = now_us;
}

static int lit_emitter(void) {
    int i = 0;
    while (i < emitter_count && !emitters[i].on) i++;
    return i;
}

/* Whole millivolts of the receiver at an input and an address of the multiplexers, or at a channel of a converter. */
static int voltage_at(int input, int address, double now_us) {
    int found = 0;
    follow(now_us);
    for (int r = 0; r < receiver_count; r++) {
        double sum = dark_mv[r];
        if (receiver_input[r] != input || receiver_address[r] != address) continue;
        if (address_count && now_us - selected_us < ADDRESS_SETTLES_US) continue;
        for (int i = 0; i < emitter_count; i++) sum += emitters[i].amplified * (emitters[i].millivolts[r] - dark_mv[r]);
        found = (int)lround(fmax(sum, 0.0));
    }
    return found;
}

/* Whole millivolts at an input. */
static int voltage_of(int input, double now_us) { return voltage_at(input, selected_address, now_us); }

/* One line of the multiplexers' address has another level. */
static void select_address(int line, int level, double now_us) {
    int address = level ? selected_address | 1 << line : selected_address & ~(1 << line);
    if (address != selected_address) selected_us = now_us;
    selected_address = address;
}

static void set_emitter(emitter *e, int on);

/* A line of the shift registers has another level: the clock takes the data in, the latch shows what was taken. */
static void shift_line(int line, int level) {
    int rises = level && !shift_level[line];
    shift_level[line] = level;
    if (rises && line == 1) shifted = shifted << 1 | (uint64_t)shift_level[0];
    if (!rises || line != 2) return;
    for (int i = 0; i < emitter_count; i++)
        if (emitters[i].port == 'Q') set_emitter(&emitters[i], (int)(shifted >> emitters[i].bit & 1));
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
    for (unsigned value; s->count < (int)strlen(hex) / 2; s->bytes[s->count++] = (uint8_t)value)
        if (sscanf(hex + 2 * s->count, "%2x", &value) != 1) refuse("no hexadecimal digits", hex);
}

static void take_emitter(char *text) {
    emitter *e = &emitters[emitter_count++];
    int end = 0;
    if (sscanf(text, "%c %d%n", &e->port, &e->bit, &end) != 2) refuse("no pin", text);
    numbers(text + end, e->millivolts);
}

static void take_converter(char *text) {
    char name[32];
    int i = converter_count++;
    if (converter_count > MOST || sscanf(text, "%31s %d", name, &converter_pin[i]) != 2) refuse("no converter", text);
    while (converter_kinds[i] < CONVERTER_KINDS && strcmp(name, converter_names[converter_kinds[i]])) converter_kinds[i]++;
    if (converter_kinds[i] == CONVERTER_KINDS) refuse("unknown converter", name);
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
    else if (!strcmp(line, "receiver") && receiver_count < MOST)
        sscanf(rest, "%d %d", &receiver_input[receiver_count], &receiver_address[receiver_count]), receiver_count++;
    else if (!strcmp(line, "shift") && shift_count < 3)
        sscanf(rest, "%c %d", &shift_port[shift_count], &shift_bit[shift_count]), shift_count++;
    else if (!strcmp(line, "address") && address_count < 8)
        sscanf(rest, "%c %d", &address_port[address_count], &address_bit[address_count]), address_count++;
    else if (!strcmp(line, "converter")) take_converter(rest);
    else if (!strcmp(line, "driver")) sscanf(rest, "%d %d %d", &driver_latch, &driver_blank, &driver_outputs);
    else if (!strcmp(line, "say")) take_speech(rest);
    else if (!strcmp(line, "emitter") && emitter_count < MOST) take_emitter(rest);
    else refuse("unknown line", line);
}

static void take_scene(const char *name) {
    FILE *file = fopen(name, "r");
    char line[4096];
    if (!file) refuse("no such scene", name);
    while (fgets(line, sizeof line, file)) take_line(line);
    fclose(file);
    if (!emitter_count || dark_count != receiver_count || light_tau_us == amplifier_tau_us) refuse("incomplete", name);
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
}

static double monotonic_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + now.tv_nsec / 1e9;
}

/* Whether whoever started the board has closed its standard input. */
static int is_left_alone(void) {
    struct pollfd input = {0, POLLIN, 0};
    char byte;
    fflush(log_file);
    return poll(&input, 1, 0) > 0 && read(0, &byte, 1) <= 0;
}
#endif
