/* Version of the firmware; the version of the protocol is generated. */
#ifndef GELLIGHT_VERSION_H
#define GELLIGHT_VERSION_H

#define FIRMWARE_MAJOR 0u
#define FIRMWARE_MINOR 3u
#define FIRMWARE_PATCH 0u

#endif
