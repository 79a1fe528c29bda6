/* Simulated run-time compiler of NVIDIA without a GPU, for tests: it passes the source to the system's C++ compiler.
 *
 *     cc -shared -fPIC -o libnvrtc.so.12 nvrtc.c
 *
 * The result is a line of text that names a shared library. Its function `fake_thread_NAME` runs one thread of the kernel NAME.
 * The library is compiled from the source for a GPU, with CUDA's keywords as macros. driver.c loads it. The libraries are deleted
 * when the process ends. CXX names another compiler than g++. */
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { OK = 0, INVALID_INPUT = 3, INVALID_PROGRAM = 4, INVALID_OPTION = 5, COMPILATION = 6 };
typedef struct Program { char *text, *log, image[400]; int architecture, is_cubin; } Program;

static const int ARCHITECTURES[] = {50, 60, 70, 80, 90};
static char *libraries[10000];
static int library_count;
static long live;

static const char PREAMBLE[] =
    "#include <cmath>\n"
    "struct Index { unsigned x, y; };\n"
    "static thread_local Index gridDim, blockIdx, threadIdx, blockDim;\n"
    "#define __global__\n#define __device__ inline\n#define __noinline__ __attribute__((noinline))\n";

__attribute__((destructor)) static void clean(void) {
    for (int k = 0; k < library_count; k++) unlink(libraries[k]);
}

long fake_programs(void) { return live; }
int nvrtcVersion(int *major, int *minor) { *major = 12; *minor = 9; return OK; }
int nvrtcGetNumSupportedArchs(int *count) { *count = sizeof ARCHITECTURES / sizeof *ARCHITECTURES; return OK; }
int nvrtcGetSupportedArchs(int *all) { memcpy(all, ARCHITECTURES, sizeof ARCHITECTURES); return OK; }
const char *nvrtcGetErrorString(int code) {
    return code == COMPILATION ? "NVRTC_ERROR_COMPILATION" : code == INVALID_OPTION ? "NVRTC_ERROR_INVALID_OPTION" : "NVRTC_ERROR";
}

int nvrtcCreateProgram(Program **program, const char *text, const char *name, int headers, char **sources, char **names) {
    (void)sources, (void)names;
    if (headers || !name) return INVALID_INPUT;
    *program = calloc(1, sizeof **program);
    (*program)->text = strdup(text);
    (*program)->log = strdup("");
    live++;
    return OK;
}
int nvrtcDestroyProgram(Program **program) {
    if (!*program) return INVALID_PROGRAM;
    free((*program)->text);
    free((*program)->log);
    free(*program);
    *program = NULL;
    live--;
    return OK;
}

/* Writes, for each kernel, a function that runs one thread, and the number of parameters; parameters are pointers to values. */
static void add_kernels(FILE *file, const char *text) {
    static const char HEAD[] = "extern \"C\" __global__ void ";
    for (const char *p = text; (p = strstr(p, HEAD));) {
        p += strlen(HEAD);
        const char *open = strchr(p, '('), *end = strchr(p, ')');
        int name = (int)(open - p), count = 0;
        fprintf(file, "extern \"C\" void fake_thread_%.*s(void **p, const unsigned *grid, const unsigned *block, unsigned thread, "
                      "unsigned threads) {\n", name, p);
        fprintf(file, "    gridDim = {grid[0], grid[1]}, blockIdx = {block[0], block[1]}, threadIdx.x = thread, blockDim.x = threads;\n    %.*s(", name, p);
        for (const char *a = open + 1; a < end; count++) {
            const char *comma = memchr(a, ',', end - a), *stop = comma ? comma : end, *last = stop;
            while (last[-1] != ' ' && last[-1] != '*') last--;
            fprintf(file, "%s*(%.*s*)p[%d]", count ? ", " : "", (int)(last - a), a, count);
            a = stop + 1;
        }
        fprintf(file, ");\n}\nextern \"C\" { int fake_parameters_%.*s = %d; }\n", name, p, count);
    }
}

int nvrtcCompileProgram(Program *program, int count, const char **options) {
    char kind[8] = "";
    for (int k = 0; k < count; k++) {
        if (sscanf(options[k], "--gpu-architecture=%7[a-z]_%d", kind, &program->architecture) == 2) continue;
        if (strncmp(options[k], "--", 2)) return INVALID_OPTION;
    }
    int known = 0;
    for (size_t k = 0; k < sizeof ARCHITECTURES / sizeof *ARCHITECTURES; k++) known |= ARCHITECTURES[k] == program->architecture;
    if (!known) {
        free(program->log);
        program->log = strdup("invalid value for --gpu-architecture");
        return INVALID_OPTION;
    }
    program->is_cubin = !strcmp(kind, "sm");

    char source[] = P_tmpdir "/condyle-XXXXXX.cpp", library[64], log[64], command[300];
    int descriptor = mkstemps(source, 4);
    FILE *file = fdopen(descriptor, "w");
    snprintf(library, sizeof library, "%.*s.so", (int)strlen(source) - 4, source);
    snprintf(log, sizeof log, "%.*s.log", (int)strlen(source) - 4, source);
    fprintf(file, "%s#line 1\n%s\n", PREAMBLE, program->text);
    add_kernels(file, program->text);
    fclose(file);
    const char *compiler = getenv("CXX");
    snprintf(command, sizeof command, "%s -O0 -w -ffp-contract=off -shared -fPIC -o %s %s > %s 2>&1", compiler ? compiler : "g++", library,
             source, log);
    int failed = system(command) != 0;
    free(program->log);
    program->log = calloc(1, 4000);
    file = fopen(log, "r");
    size_t length = fread(program->log, 1, 3999, file);
    program->log[length] = 0;
    fclose(file);
    unlink(source);
    unlink(log);
    if (failed) return COMPILATION;
    libraries[library_count++] = strdup(library);
    snprintf(program->image, sizeof program->image, "// FAKE %s %d %s\n", program->is_cubin ? "CUBIN" : "PTX", program->architecture, library);
    return OK;
}

int nvrtcGetProgramLogSize(Program *program, size_t *size) { *size = strlen(program->log) + 1; return OK; }
int nvrtcGetProgramLog(Program *program, char *log) { strcpy(log, program->log); return OK; }
/* Returns, as NVIDIA's function does, the size of a CUBIN, or 0 if the image is PTX. */
int nvrtcGetCUBINSize(Program *program, size_t *size) { *size = program->is_cubin ? strlen(program->image) + 1 : 0; return OK; }
int nvrtcGetCUBIN(Program *program, char *image) { strcpy(image, program->image); return OK; }
int nvrtcGetPTXSize(Program *program, size_t *size) { *size = strlen(program->image) + 1; return OK; }
int nvrtcGetPTX(Program *program, char *image) { strcpy(image, program->image); return OK; }
