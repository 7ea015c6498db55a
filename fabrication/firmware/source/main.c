#include "core.h"
int main(void) { for (core_init();;) core_step(); }
