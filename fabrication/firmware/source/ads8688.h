/* Commands of ADS8688 converters, included by core.cpp. */
#if !CONVERTER_IS_ADS8688
#error "these are the commands of ADS8688 converters, and config.h names others"
#endif

/* A transfer returns the channel that the previous transfer selected, so each transfer selects the next receiver. */
static uint16_t selecting(uint8_t chip, uint8_t next_address) {
    uint8_t bytes[] = {(uint8_t)(0xc0 | next_address << 2), 0, 0, 0};
    exchange(chip, bytes, sizeof bytes);
    return bytes[2] << 8 | bytes[3];
}

/* Receivers of a converter are consecutive. With the last receiver, the first one is selected for the next state. */
static uint16_t reading_of(uint8_t receiver, bool is_last) {
    uint8_t chip = channel_chips[receiver], next = receiver + is_last;
    bool has_next = next < N_RECEIVERS && channel_chips[next] == chip;
    return selecting(chip, has_next ? channel_addresses[next] : 0);
}

static void start_converters(void) {
    for (uint8_t chip = 0; chip < CONVERTERS; chip++) {
        for (uint8_t channel = 0; channel < CONVERTER_CHANNELS; channel++) {
            uint8_t bytes[] = {(uint8_t)((5 + channel) << 1 | 1), CONVERTER_RANGE, 0}; /* writes its range register */
            exchange(chip, bytes, sizeof bytes);
        }
        selecting(chip, 0);
    }
}
