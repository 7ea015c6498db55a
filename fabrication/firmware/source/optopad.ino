#include "core.h"
void setup() { core_init(); }
void loop() { core_step(); }
