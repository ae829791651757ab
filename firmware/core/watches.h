/* What is watched all the time: the host, the trigger, the heat, and a restart that was asked for. */
#ifndef GELLIGHT_WATCHES_H
#define GELLIGHT_WATCHES_H

#include "state.h"

void watches_look(struct controller *controller);

/* Go dark, and start anew once the reply and the darkness are out. */
void watches_restart(struct controller *controller, bool bootloader);

#endif
