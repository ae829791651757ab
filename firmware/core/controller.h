/*
 * The light ring as a whole: bytes from the host go in, lights and replies come out, and nothing stays lit that no
 * host wants any more. The board calls controller_receive() for each byte, controller_link() when the connection
 * comes or goes, and controller_poll() whenever anything happened and at least every 10 ms.
 */
#ifndef GELLIGHT_CONTROLLER_H
#define GELLIGHT_CONTROLLER_H

#include "state.h"

/* Start with dark LEDs; the light that makes them so is under way when this returns. */
void controller_start(struct controller *controller, const struct port *port);
void controller_receive(struct controller *controller, uint8_t byte);
void controller_link(struct controller *controller, bool open, enum dark reason);
void controller_poll(struct controller *controller);

/* False when a light is overdue or does not get through: then the board must not feed its watchdog. */
bool controller_healthy(const struct controller *controller);

#endif
