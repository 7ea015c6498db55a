/* Data of a chain of TLC5947 LED drivers, included by core.cpp. */
static const uint8_t driver_pins[] = {DRIVER_PINS};
enum driver_line { LATCH, BLANK };
#define DRIVER_BITS (1UL * DRIVER_OUTPUTS * GRAYSCALE_BITS)
#define DRIVER_BYTES ((DRIVER_BITS + 7) / 8)

static void put(driver_line line, bool is_high) {
    digitalWrite(driver_pins[line], is_high ? HIGH : LOW);
    delayMicroseconds(1);
}

/* Sends the data of all outputs, the last output first: full grayscale for the lit one, 0 for the others. The new data
   are latched while the outputs are blanked. The end of blanking begins a PWM period. The emitter is on from
   DRIVER_ON_US after that until the end of the period. */
static void light(uint8_t emitter) {
    uint8_t bytes[DRIVER_BYTES] = {}; /* the received bytes replace the sent ones */
    uint16_t at = DRIVER_BYTES * 8 - (emitter + 1) * GRAYSCALE_BITS;
    for (uint16_t bit = at; emitter < N_EMITTERS && bit < at + GRAYSCALE_BITS; bit++) bytes[bit / 8] |= 0x80 >> bit % 8;
    SPI.beginTransaction(SPISettings(DRIVER_HZ, MSBFIRST, SPI_MODE0));
    SPI.transfer(bytes, sizeof bytes);
    SPI.endTransaction();
    put(BLANK, true);
    put(LATCH, true);
    put(LATCH, false);
    put(BLANK, false);
    delayMicroseconds(DRIVER_ON_US);
}

static void start_drivers(void) {
    for (uint8_t pin : driver_pins) {
        pinMode(pin, OUTPUT);
        digitalWrite(pin, pin == driver_pins[BLANK] ? HIGH : LOW);
    }
}
