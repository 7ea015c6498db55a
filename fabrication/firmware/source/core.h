/* The sensor's program: call core_init once, then core_step forever. */
#ifndef OPTOPAD_CORE_H
#define OPTOPAD_CORE_H
#ifdef __cplusplus
extern "C" {
#endif
void core_init(void);
void core_step(void);
#ifdef __cplusplus
}
#endif
#endif
