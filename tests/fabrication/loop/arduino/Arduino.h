/* As much of an Arduino core as the portable program may use; `board.cpp` is the board behind it. */
#ifndef ARDUINO_H
#define ARDUINO_H
#include <stddef.h>
#include <stdint.h>

enum PinStatus { LOW, HIGH };
enum PinMode { INPUT, OUTPUT };
enum : uint8_t { A0 = 54, A1, A2, A3, A4, A5, A6, A7, A8, A9, A10, A11, A12, A13, A14, A15 };

void setup();
void loop();
unsigned long micros();
void delayMicroseconds(unsigned int us);
void pinMode(uint8_t pin, PinMode mode);
void digitalWrite(uint8_t pin, PinStatus level);
int analogRead(uint8_t pin);
void analogReadResolution(int bits);

struct SerialLine {
    void begin(unsigned long baud);
    int available();
    int read();
    int availableForWrite();
    size_t write(const uint8_t *bytes, size_t count);
};
extern SerialLine Serial;
#endif
