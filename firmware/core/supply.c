#include "supply.h"

#include "protocol.h"

void supply_close(struct supply *supply, const struct port *port)
{
    if (!supply->fitted || supply->closed)
        return;
    supply->closed = true;
    supply->settled_us = port->micros(port->context) + SUPPLY_US;
    port->power(port->context, true);
}

void supply_open(struct supply *supply, const struct port *port)
{
    if (!supply->closed)
        return;
    supply->closed = false;
    port->power(port->context, false);
}
