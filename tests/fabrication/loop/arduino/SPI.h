/* As much of an Arduino core's SPI library as the portable program may use; `spi_chips.h` has the chips on the bus. */
#ifndef SPI_H
#define SPI_H
#include <stddef.h>
#include <stdint.h>

enum BitOrder { LSBFIRST, MSBFIRST };
enum SPIMode : uint8_t { SPI_MODE0, SPI_MODE1, SPI_MODE2, SPI_MODE3 };

struct SPISettings {
    SPISettings(uint32_t clock_hz, BitOrder order, uint8_t mode) : clock_hz(clock_hz), order(order), mode(mode) {}
    uint32_t clock_hz;
    BitOrder order;
    uint8_t mode;
};

struct SpiBus {
    void begin();
    void beginTransaction(SPISettings settings);
    void transfer(void *bytes, size_t count);
    void endTransaction();
};
extern SpiBus SPI;
#endif
