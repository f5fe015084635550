/* An ego in C, without a JSON library: ego protocol 1 on stdin and stdout.
 *
 *     cc -O2 -o ego examples/ego.c && brakecheck check -- ./ego
 *
 * It brakes for the first of the others that is ahead and nearer than two
 * seconds. Keys are looked for by name, so their order does not matter and
 * unknown ones are passed over; a real ego would use a JSON parser.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The number after "key": in text; or otherwise, if there is none. */
static double number(const char *text, const char *key, double otherwise) {
    char quoted[64];
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    const char *found = text ? strstr(text, quoted) : NULL;
    return found ? strtod(found + strlen(quoted), NULL) : otherwise;
}

int main(void) {
    static char line[1 << 20];
    while (fgets(line, sizeof line, stdin)) {
        long id = (long)number(line, "id", 0);
        if (strstr(line, "\"hello\"")) {
            puts("{\"hello\":{\"protocol\":1,\"name\":\"two seconds, in C\"}}");
        } else if (strstr(line, "\"reset\"")) {
            printf("{\"id\":%ld,\"ready\":true}\n", id);
        } else if (strstr(line, "\"step\"")) {
            double speed = number(strstr(line, "\"own\""), "speed_mps", 0);
            double headway = number(strstr(line, "\"others\""), "headway_m", 1e9);
            double accel = 0 < headway && headway < 2 * speed + 5 ? -4 : 0;
            printf("{\"id\":%ld,\"accel_mps2\":%g}\n", id, accel);
        } else if (strstr(line, "\"close\"")) {
            break;
        }
        fflush(stdout); /* without this the answer stays in a buffer */
    }
    return 0;
}
