/* Chips on the simulated board's SPI bus, bit by bit: MCP3208, ADS8688 and ADS7953 converters, and a chain of TLC5947.

   A program that breaks a limit of a data sheet is refused: clock and mode of the bus, time between two frames, two
   chips that drive the data line at once, data latched while the outputs are on. The bus's clock takes its time, and a
   converter holds its input at the edge at which the chip does.

   Definition: GRAY_STEP_NS, a period of the TLC5947's oscillator.

   Left out: setup and hold times of some nanoseconds. */
#ifndef OPTOPAD_SPI_CHIPS_H
#define OPTOPAD_SPI_CHIPS_H
#include "../scene.h"
#include "SPI.h"

#define GRAY_BITS 12
#define FULL_GRAY 4095
#ifndef GRAY_STEP_NS
#define GRAY_STEP_NS 250
#endif
#define GRAY_PERIOD_NS (4096ULL * GRAY_STEP_NS)
#define TURN_ON_STEPS 5
#define ADS_UNIPOLAR_5V12 6
#define ADS_UNIPOLAR_10V24 5

typedef struct {
    int is_low, bits, start, selected, held_mv, doubles, sending, converted;
    uint32_t heard;
    uint64_t rose_ns;
    uint8_t range[8];
} spi_converter;

SpiBus SPI;

static spi_converter chips[MOST];
static SPISettings bus_settings(0, LSBFIRST, 255);
static bool has_bus, in_transaction;
static uint8_t chain[MOST * GRAY_BITS], latched[MOST * GRAY_BITS];
static int latch_level, blank_level = 1;
static uint64_t pwm_event_ns;
static bool pwm_is_on, pwm_runs;

static void set_emitter_at(emitter *e, int on, uint64_t at_ns);

/* ---- LED drivers */

static int gray_of(int output) {
    int value = 0;
    for (int bit = GRAY_BITS - 1; bit >= 0; bit--) value = value << 1 | latched[output * GRAY_BITS + bit];
    if (value && value != FULL_GRAY) refuse("grayscale between off and full", "tlc5947");
    return value;
}

static void switch_outputs(int on, uint64_t at_ns) {
    for (int i = 0; i < emitter_count; i++)
        if (emitters[i].port == 'Q') set_emitter_at(&emitters[i], on && gray_of(emitters[i].bit), at_ns);
}

/* Outputs are on for FULL_GRAY steps of each period, and off for the last step. */
static void run_drivers(uint64_t until_ns) {
    while (pwm_runs && pwm_event_ns <= until_ns) {
        pwm_is_on = !pwm_is_on;
        switch_outputs(pwm_is_on, pwm_event_ns);
        pwm_event_ns += pwm_is_on ? FULL_GRAY * GRAY_STEP_NS : GRAY_PERIOD_NS - FULL_GRAY * GRAY_STEP_NS;
    }
}

static void driver_line(uint8_t pin, int level, uint64_t now_ns) {
    if (!driver_outputs) return;
    run_drivers(now_ns);
    if (pin == driver_latch) {
        if (level && !latch_level) {
            if (!blank_level) refuse("data latched while the outputs are on", "tlc5947");
            memcpy(latched, chain, sizeof latched);
        }
        latch_level = level;
    } else if (pin == driver_blank) {
        if (level) switch_outputs(0, now_ns);
        if (blank_level && !level) pwm_event_ns = now_ns + TURN_ON_STEPS * GRAY_STEP_NS;
        pwm_runs = !level;
        if (level || !blank_level) pwm_is_on = pwm_is_on && !level;
        blank_level = level;
    }
}

static void shift_driver(int bit) {
    memmove(chain + 1, chain, sizeof chain - 1);
    chain[0] = bit;
}

/* ---- converters */

static int code_of(int millivolts, double full_scale_mv, int bits) {
    long most = (1L << bits) - 1, code = (long)(millivolts * (double)most / full_scale_mv);
    return (int)(code < 0 ? 0 : code > most ? most : code);
}

static int hold(int which, int input, uint64_t now_ns) {
    run_drivers(now_ns);
    int held_mv = voltage_at(which, input, now_ns / 1e3);
    int inputs = converter_kinds[which] == ADS7953 ? 16 : 8;
    record(now_ns, INPUT_HELD, which * inputs + input + 256 * lit_emitter(), held_mv);
    return held_mv;
}

/* The start bit may be anywhere; the input is held 5 clocks behind it, and the result follows a bit of 0. */
static int mcp3208_bit(int which, spi_converter *chip, int bit, uint64_t now_ns) {
    int at = chip->bits++, since = chip->start < 0 ? 0 : at - chip->start;
    if (chip->start < 0 && bit) chip->start = at;
    if (since >= 1 && since <= 4) chip->heard = chip->heard << 1 | (uint32_t)bit;
    if (since == 5) {
        if (!(chip->heard & 8)) refuse("a differential input", "mcp3208");
        chip->held_mv = hold(which, chip->heard & 7, now_ns);
    }
    return since >= 7 && since <= 18 ? code_of(chip->held_mv, supply_mv, 12) >> (18 - since) & 1 : 0;
}

/* A frame gives the code of the input that was held when it began. */
static int ads8688_bit(spi_converter *chip, int bit) {
    int at = chip->bits++, code = 0;
    chip->heard = chip->heard << 1 | (uint32_t)bit;
    if (chip->selected < 0) return 1;
    uint8_t range = chip->range[chip->selected];
    if (range == ADS_UNIPOLAR_5V12) code = code_of(chip->held_mv, 5120, 16);
    else if (range == ADS_UNIPOLAR_10V24) code = code_of(chip->held_mv, 10240, 16);
    else if (range) refuse("a range that no test uses", "ads8688");
    else code = code_of(chip->held_mv + 10240, 20480, 16);
    return at >= 16 && at < 32 ? code >> (31 - at) & 1 : 0;
}

static void ads8688_obeys(spi_converter *chip) {
    uint32_t word = chip->bits >= 32 ? chip->heard >> 16 : chip->bits >= 24 ? chip->heard >> 8 & 0xffff : 0;
    if ((word & 0xe3ff) == 0xc000) chip->selected = word >> 10 & 7;
    int address = word >> 9;
    if (word & 0x100 && address >= 5 && address <= 12) chip->range[address - 5] = word & 15;
}

/* A frame sends the result of the frame before, and converts the input that was held when it began. */
static int ads7953_bit(spi_converter *chip, int bit) {
    int at = chip->bits++;
    chip->heard = chip->heard << 1 | (uint32_t)bit;
    return at < 16 ? chip->sending >> (15 - at) & 1 : 0;
}

static void ads7953_begins(int which, spi_converter *chip, uint64_t now_ns) {
    chip->sending = chip->converted;
    if (chip->selected < 0) return;
    chip->held_mv = hold(which, chip->selected, now_ns);
    chip->converted = chip->selected << 12 | code_of(chip->held_mv, chip->doubles ? 5000 : 2500, 12);
}

static void ads7953_obeys(spi_converter *chip) {
    if (chip->bits != 16 || chip->heard >> 12 != 1) refuse("not a frame of the manual mode", "ads7953");
    if (chip->heard & 0x3f) refuse("power down, or data of its own pins", "ads7953");
    if (!(chip->heard & 0x800)) return;
    chip->selected = chip->heard >> 7 & 15;
    chip->doubles = chip->heard >> 6 & 1;
}

static int bit_of(int which, int bit, uint64_t now_ns) {
    spi_converter *chip = &chips[which];
    if (converter_kinds[which] == ADS8688) return ads8688_bit(chip, bit);
    return converter_kinds[which] == ADS7953 ? ads7953_bit(chip, bit) : mcp3208_bit(which, chip, bit, now_ns);
}

static const unsigned least_gap_ns[] = {500, 1150, 325};

static void select_chip(uint8_t pin, int level, uint64_t now_ns) {
    for (int i = 0; i < converter_count; i++) {
        spi_converter *chip = &chips[i];
        int kind = converter_kinds[i];
        if (converter_pin[i] != pin || chip->is_low == !level) continue;
        chip->is_low = !level;
        if (level) {
            chip->rose_ns = now_ns;
            if (kind == ADS8688) ads8688_obeys(chip);
            if (kind == ADS7953) ads7953_obeys(chip);
            continue;
        }
        if (chip->rose_ns && now_ns - chip->rose_ns < least_gap_ns[kind]) refuse("too soon after the last frame", "converter");
        chip->bits = chip->heard = 0;
        chip->start = -1;
        if (kind == ADS7953) ads7953_begins(i, chip, now_ns);
        if (kind == ADS8688 && chip->selected >= 0) chip->held_mv = hold(i, chip->selected, now_ns);
    }
}

/* ---- the bus */

static uint64_t core_now_ns();
static void core_pass_ns(double ns);

void SpiBus::begin() {
    has_bus = true;
    for (spi_converter &chip : chips) chip.selected = -1;
}

void SpiBus::beginTransaction(SPISettings settings) {
    bus_settings = settings;
    in_transaction = true;
}

void SpiBus::endTransaction() { in_transaction = false; }

static void check_bus() {
    int low = 0;
    double most_hz = driver_outputs > 24 ? 15e6 : 30e6;
    if (!has_bus || !in_transaction || bus_settings.order != MSBFIRST) refuse("not begun", "SPI");
    for (int i = 0; i < converter_count; i++) {
        if (!chips[i].is_low) continue;
        low++;
        int kind = converter_kinds[i];
        most_hz = kind == ADS8688 ? 17e6 : kind == ADS7953 ? 20e6 : supply_mv >= 4750 ? 2e6 : 1e6;
        if (bus_settings.mode != (kind == ADS8688 ? SPI_MODE1 : SPI_MODE0)) refuse("the mode of the bus", "converter");
    }
    if (low > 1) refuse("two chip selects are low", "SPI");
    if (!low && bus_settings.mode != SPI_MODE0) refuse("the mode of the bus", "tlc5947");
    if (bus_settings.clock_hz > most_hz) refuse("the clock of the bus is too fast", "SPI");
}

void SpiBus::transfer(void *bytes, size_t count) {
    uint8_t *at = (uint8_t *)bytes;
    check_bus();
    for (size_t k = 0; k < 8 * count; k++) {
        uint8_t mask = 0x80 >> k % 8;
        int sent = at[k / 8] & mask ? 1 : 0, heard = 0;
        core_pass_ns(1e9 / bus_settings.clock_hz);
        shift_driver(sent);
        for (int i = 0; i < converter_count; i++) {
            if (!chips[i].is_low) continue;
            heard = bit_of(i, sent, core_now_ns());
        }
        at[k / 8] = (uint8_t)(heard ? at[k / 8] | mask : at[k / 8] & ~mask);
    }
}
#endif
