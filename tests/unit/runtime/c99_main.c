/* c99_test.c as a program of its own. */
int c99_program(void);

int main(void) { return c99_program(); }
