/* Commands of MCP3208 converters, included by core.cpp. */
#if !CONVERTER_IS_MCP3208
#error "these are the commands of MCP3208 converters, and config.h names others"
#endif

/* Sends a start bit, the single-ended bit and three bits of the input. The reading returns in the same transfer. */
static uint16_t reading_of(uint8_t receiver, bool) {
    uint8_t address = channel_addresses[receiver];
    uint8_t bytes[] = {(uint8_t)(6 | address >> 2), (uint8_t)(address << 6), 0};
    exchange(channel_chips[receiver], bytes, sizeof bytes);
    return (bytes[1] & 15) << 8 | bytes[2];
}

static void start_converters(void) {}
