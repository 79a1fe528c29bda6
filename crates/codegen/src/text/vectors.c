/* Vectors of WIDTH numbers, one of each state; WHOLE extends a constant to a vector. */
typedef REAL NAME_real __attribute__((vector_size(BYTES)));
typedef REAL NAME_memory __attribute__((vector_size(BYTES), aligned(SIZE), may_alias));
typedef INTEGER NAME_mask __attribute__((vector_size(BYTES)));
#define AT(array, k) (*(NAME_memory *)((array) + WIDTH * (k)))
#define WHOLE(x) ((x) + (NAME_real){0})
#define SELECT(m, a, b) ((NAME_real)(((NAME_mask)(a) & (m)) | ((NAME_mask)(b) & ~(m))))
#define ABS(x) ((NAME_real)((NAME_mask)(x) & LARGEST))
#define SQRT(x) \
    __extension__({ \
        const NAME_real NAME_x = (x); \
        NAME_real NAME_root; \
        for (int NAME_k = 0; NAME_k < WIDTH; NAME_k++) NAME_root[NAME_k] = ROOT_OF(NAME_x[NAME_k]); \
        NAME_root; \
    })
#define ATAN2(y, x) \
    __extension__({ \
        const NAME_real NAME_y = (y), NAME_x = (x); \
        NAME_real NAME_angle; \
        for (int NAME_k = 0; NAME_k < WIDTH; NAME_k++) NAME_angle[NAME_k] = ANGLE_OF(NAME_y[NAME_k], NAME_x[NAME_k]); \
        NAME_angle; \
    })

