/* Commands of ADS7953 converters, included by core.cpp. */
#if !CONVERTER_IS_ADS7953
#error "these are the commands of ADS7953 converters, and config.h names others"
#endif

/* Manual mode: a frame selects the input and the range, the next one holds and converts, and the third one returns the
   result below the number of the input. */
static uint16_t reading_of(uint8_t receiver, bool) {
    uint16_t command = 0x1800 | channel_addresses[receiver] << 7 | CONVERTER_RANGE << 6, answer = 0;
    for (uint8_t frame = 0; frame < 3; frame++) {
        uint8_t bytes[] = {(uint8_t)(command >> 8), (uint8_t)command};
        exchange(channel_chips[receiver], bytes, sizeof bytes);
        answer = bytes[0] << 8 | bytes[1];
    }
    return answer & 0xfff;
}

static void start_converters(void) {}
