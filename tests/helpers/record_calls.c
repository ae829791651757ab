// Loaded before a program's libraries (LD_PRELOAD), writes down whom it asks for a name and where it sends.
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

static void note(const char *what, const char *whom)
{
    const char *path = getenv("RECORD_CALLS");
    char line[512];
    int length = snprintf(line, sizeof line, "%s %s\n", what, whom ? whom : "");
    int file = path ? open(path, O_WRONLY | O_APPEND | O_CREAT, 0600) : -1;

    if (file >= 0 && length > 0 && write(file, line, (size_t)length) < 0)
        perror(path);
    if (file >= 0)
        close(file);
}

static void note_address(const struct sockaddr *address)
{
    char text[INET6_ADDRSTRLEN] = "";

    if (address && address->sa_family == AF_INET)
        inet_ntop(AF_INET, &((const struct sockaddr_in *)(const void *)address)->sin_addr, text, sizeof text);
    if (address && address->sa_family == AF_INET6)
        inet_ntop(AF_INET6, &((const struct sockaddr_in6 *)(const void *)address)->sin6_addr, text, sizeof text);
    if (text[0])
        note("send", text);
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

int getaddrinfo(const char *node, const char *service, const struct addrinfo *hints, struct addrinfo **found)
{
    note("name", node);
    return NEXT(getaddrinfo)(node, service, hints, found);
}

struct hostent *gethostbyname(const char *name)
{
    note("name", name);
    return NEXT(gethostbyname)(name);
}

int connect(int socket, const struct sockaddr *address, socklen_t length)
{
    note_address(address);
    return NEXT(connect)(socket, address, length);
}

ssize_t sendto(int socket, const void *data, size_t size, int flags, const struct sockaddr *address, socklen_t length)
{
    note_address(address);
    return NEXT(sendto)(socket, data, size, flags, address, length);
}

ssize_t sendmsg(int socket, const struct msghdr *message, int flags)
{
    note_address(message->msg_name);
    return NEXT(sendmsg)(socket, message, flags);
}
