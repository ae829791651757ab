/* What the board tells the host about itself: a CDC-ACM serial port. */
#include "board.h"

#include "bytes.h"

#define DEVICE 1u
#define CONFIGURATION 2u
#define STRING 3u

static const uint8_t device[] = {
    18, DEVICE,
    0x00, 0x02,       /* USB 2.0 */
    0xef, 2, 1,       /* interface association */
    64,               /* endpoint 0 */
    0x09, 0x12,       /* 1209: pid.codes */
    0x01, 0x00,       /* 0001: for tests; a product needs its own */
    0x00, 0x01,       /* version 1.00 */
    1, 2, 3,          /* manufacturer, product, serial number */
    1,                /* configuration */
};

static const uint8_t configuration[] = {
    9, CONFIGURATION, 75, 0, 2, 1, 0, 0x80, 250, /* two interfaces, bus powered, 500 mA */
    8, 11, 0, 2, 2, 2, 0, 0,                     /* interfaces 0 and 1 are one function */
    9, 4, 0, 0, 1, 2, 2, 0, 0,                   /* communication: abstract control model */
    5, 0x24, 0, 0x10, 1,
    5, 0x24, 1, 0, 1,
    4, 0x24, 2, 6,                               /* line coding, control line state, break */
    5, 0x24, 6, 0, 1,
    7, 5, 0x81, 3, 8, 0, 16,                     /* notifications, never sent */
    9, 4, 1, 0, 2, 10, 0, 0, 0,                  /* data */
    7, 5, 0x02, 2, 64, 0, 0,
    7, 5, 0x82, 2, 64, 0, 0,
};
_Static_assert(sizeof configuration == 9 + 8 + 9 + 5 + 5 + 4 + 5 + 7 + 9 + 7 + 7, "length in the descriptor");

static const char *const texts[] = {"GelLight", "GelLight light ring"};
static char serial_number[17];
static uint8_t text_descriptor[2 + 2 * 24];

void usb_serial_number(const uint8_t unique_id[8])
{
    static const char digits[] = "0123456789ABCDEF";
    for (uint32_t i = 0; i < 8; i++) {
        serial_number[2 * i] = digits[unique_id[i] >> 4];
        serial_number[2 * i + 1] = digits[unique_id[i] & 15];
    }
}

static const uint8_t *text(const char *characters, uint16_t *count)
{
    uint8_t used = 2;
    while (*characters && used < sizeof text_descriptor) {
        text_descriptor[used++] = (uint8_t)*characters++;
        text_descriptor[used++] = 0;
    }
    text_descriptor[0] = used;
    text_descriptor[1] = STRING;
    *count = used;
    return text_descriptor;
}

static const uint8_t *languages(uint16_t *count)
{
    static const uint8_t english[] = {4, STRING, 0x09, 0x04};
    *count = sizeof english;
    return english;
}

const uint8_t *usb_descriptor(uint8_t type, uint8_t index, uint16_t *count)
{
    *count = type == DEVICE ? sizeof device : sizeof configuration;
    if (type == DEVICE)
        return device;
    if (type == CONFIGURATION && index == 0)
        return configuration;
    if (type == STRING && index == 0)
        return languages(count);
    if (type == STRING && index <= 2)
        return text(texts[index - 1], count);
    if (type == STRING && index == 3)
        return text(serial_number, count);
    return NULL;
}
