/* A simulated board with an Arduino core around the portable program, compiled for this machine; see ../scene.h.

   usage: board SCENE LOG MICROSECONDS [pty]

   Its clock is simulated, so that a run repeats itself to the bit: every call of the core takes a tenth of a microsecond,
   a conversion CONVERSION_US. The input is held when the conversion begins. The line takes bytes at its rate from a
   buffer of 64; said bytes come at that rate into one of 256. With `pty` the line is a pseudo-terminal, whose name is
   printed, and the clock is no faster than real time, until the time is over or the standard input ends.

   Definitions: FIRST_US, the clock at reset; DITHER, readings rise by 0, 1, ... DITHER - 1 counts in turn; STALL_FROM_US
   and STALL_TO_US, when the host takes nothing; ROOM_NEVER_TOLD, a core whose writing waits, as some do. */
#include "Arduino.h"

#include "../scene.h"
#include "spi_chips.h"

#ifndef CONVERSION_US
#define CONVERSION_US 2
#endif
#ifndef FIRST_US
#define FIRST_US 0
#endif
#ifndef DITHER
#define DITHER 1
#endif
#ifndef STALL_FROM_US
#define STALL_FROM_US 0
#define STALL_TO_US 0
#endif
#define CALL_NS 100
#define SENT_BYTES 64
#define HEARD_BYTES 256
#define TERMINAL_BYTES 512
#define LOOK_NS 1000000 /* how often a terminal is looked at, and the clock held back */

SerialLine Serial;

static uint64_t now_ns, line_free_ns, next_look_ns;
static double next_said_us;
static uint8_t heard[HEARD_BYTES];
static unsigned heard_start, heard_end, conversions;
static int resolution = 10;
static bool is_output[256], has_begun;

unsigned long micros() {
    now_ns += CALL_NS;
    return (uint32_t)(FIRST_US + now_ns / 1000);
}

void delayMicroseconds(unsigned int us) { now_ns += us * 1000u; }

/* ---- pins */

void pinMode(uint8_t pin, PinMode mode) { is_output[pin] = mode == OUTPUT; }

static void set_emitter_at(emitter *e, int on, uint64_t at_ns) {
    if (e->on == on) return;
    follow(at_ns / 1e3);
    e->on = on;
    record(at_ns, EMITTER_SWITCHED, 2 * (int)(e - emitters) + on, 0);
}

static void set_emitter(emitter *e, int on) { set_emitter_at(e, on, now_ns); }

static uint64_t core_now_ns() { return now_ns; }

/* The clock is in whole nanoseconds; what is left of one is passed on. */
static void core_pass_ns(double ns) {
    static double left_ns;
    left_ns += ns;
    now_ns += (uint64_t)left_ns;
    left_ns -= (uint64_t)left_ns;
}

void digitalWrite(uint8_t pin, PinStatus level) {
    now_ns += CALL_NS;
    if (!is_output[pin]) refuse("no output", "digitalWrite");
    for (int i = 0; i < address_count; i++)
        if (address_bit[i] == pin) select_address(i, level, now_ns / 1e3);
    for (int i = 0; i < shift_count; i++)
        if (shift_bit[i] == pin) shift_line(i, level);
    select_chip(pin, level, now_ns);
    driver_line(pin, level, now_ns);
    for (int i = 0; i < emitter_count; i++)
        if (emitters[i].port != 'Q' && emitters[i].bit == pin) set_emitter(&emitters[i], level);
}

void analogReadResolution(int bits) { resolution = bits; }

int analogRead(uint8_t pin) {
    int held_mv = voltage_of(pin, now_ns / 1e3);
    record(now_ns, INPUT_HELD, pin + 256 * lit_emitter(), held_mv);
    now_ns += CONVERSION_US * 1000;
    return (int)(held_mv * ((1L << resolution) - 1) / (long)supply_mv + conversions++ % DITHER);
}

/* ---- the line */

static uint64_t byte_ns() { return (uint64_t)(BITS_PER_BYTE / baud * 1e9); }

static int room() {
    uint64_t queued = line_free_ns > now_ns ? (line_free_ns - now_ns + byte_ns() - 1) / byte_ns() : 0;
    return queued < SENT_BYTES ? (int)(SENT_BYTES - queued) : 0;
}

static void hear(uint8_t byte) {
    if (heard_end - heard_start < HEARD_BYTES) heard[heard_end++ % HEARD_BYTES] = byte;
}

static void look_at_terminal() {
    uint8_t bytes[HEARD_BYTES];
    if (now_ns < next_look_ns || heard_start != heard_end) return;
    next_look_ns = now_ns + LOOK_NS;
    ssize_t count = ::read(terminal, bytes, sizeof bytes);
    for (ssize_t i = 0; i < count; i++) hear(bytes[i]);
}

static void hear_what_was_said() {
    while (current_speech < speech_count) {
        speech *s = &speeches[current_speech];
        double at_us = fmax(s->at_us, next_said_us);
        if (at_us > now_ns / 1e3) return;
        hear(s->bytes[s->next++]);
        next_said_us = at_us + byte_ns() / 1e3;
        if (s->next == s->count) current_speech++;
    }
}

void SerialLine::begin(unsigned long) { has_begun = true; }

int SerialLine::available() {
    now_ns += CALL_NS;
    if (terminal < 0) hear_what_was_said();
    else look_at_terminal();
    return (int)(heard_end - heard_start);
}

int SerialLine::read() { return heard_start == heard_end ? -1 : heard[heard_start++ % HEARD_BYTES]; }

int SerialLine::availableForWrite() {
    now_ns += CALL_NS;
#ifdef ROOM_NEVER_TOLD
    return 0;
#endif
    return !has_begun ? 0 : terminal < 0 ? room() : TERMINAL_BYTES;
}

size_t SerialLine::write(const uint8_t *bytes, size_t count) {
    now_ns += CALL_NS;
    if (terminal >= 0) {
        ssize_t taken = ::write(terminal, bytes, count);
        return taken < 0 ? 0 : (size_t)taken; /* the terminal is full */
    }
    for (size_t i = 0; i < count; i++) {
        while (!room()) now_ns += CALL_NS;
        uint64_t begun_ns = line_free_ns > now_ns ? line_free_ns : now_ns;
        if (begun_ns >= STALL_FROM_US * 1000ULL && begun_ns < STALL_TO_US * 1000ULL) begun_ns = STALL_TO_US * 1000ULL;
        record(begun_ns, BYTE_SENT, bytes[i], 0);
        line_free_ns = begun_ns + byte_ns();
    }
    return count;
}

int main(int count, char **arguments) {
    if (count < 4) refuse("usage", "board SCENE LOG MICROSECONDS [pty]");
    take_scene(arguments[1]);
    if (!(log_file = fopen(arguments[2], "wb"))) refuse("cannot be written", arguments[2]);
    if (count > 4) open_terminal();
    double start_s = monotonic_s();
    uint64_t end_ns = (uint64_t)(atof(arguments[3]) * 1e3), next_rest_ns = 0;
    for (setup(); now_ns < end_ns; loop()) {
        if (terminal < 0 || now_ns < next_rest_ns) continue;
        next_rest_ns = now_ns + LOOK_NS;
        double ahead_s = now_ns / 1e9 - (monotonic_s() - start_s);
        if (ahead_s > 0) usleep((useconds_t)(ahead_s * 1e6));
        if (is_left_alone()) break;
    }
    fclose(log_file);
    return 0;
}
