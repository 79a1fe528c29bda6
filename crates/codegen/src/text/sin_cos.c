/* double */
/* Replaces n angles by their sines, and computes their cosines. x = n pi/2 + r with |r| <= pi/4; n pi/2 is subtracted
 * in three parts (Cody and Waite). Sine and cosine of r are polynomials with the coefficients of Moshier's Cephes
 * library. */
static inline void NAME_sin_cos(int n, double *restrict sine, double *restrict cosine) {
    int far = 0;
    for (int k = 0; k < n; k++) {
        far |= !(fabs(sine[k]) <= 1e5);
    }
    if (far) {
        for (int k = 0; k < n; k++) {
            cosine[k] = cos(sine[k]);
            sine[k] = sin(sine[k]);
        }
        return;
    }
    for (int k = 0; k < n; k++) {
        const double x = sine[k];
        const double turns = floor(x * 0.6366197723675814 + 0.5);
        double r = x - turns * 1.570796251296997;
        r = r - turns * 7.549789415861596e-8;
        r = r - turns * 5.390302858158119e-15;
        const double z = r * r;
        double p = 1.5896230157654656e-10;
        p = p * z + -2.5050747762857807e-8;
        p = p * z + 2.7557313621385722e-6;
        p = p * z + -1.984126982958954e-4;
        p = p * z + 8.333333333322118e-3;
        p = p * z + -1.666666666666663e-1;
        double c = -1.1358536521387682e-11;
        c = c * z + 2.087570084197473e-9;
        c = c * z + -2.755731417929674e-7;
        c = c * z + 2.4801587288851704e-5;
        c = c * z + -1.3888888888873056e-3;
        c = c * z + 4.1666666666666595e-2;
        const double s0 = p * z * r + r;
        const double c0 = c * z * z + (1.0 - 0.5 * z);
        /* the quadrant, 0 to 3: (sin, cos), (cos, -sin), (-sin, -cos), (-cos, sin) */
        const double quadrant = turns - 4.0 * floor(turns * 0.25);
        const double half = quadrant - 2.0 * floor(quadrant * 0.5);
        const double s1 = half != 0.0 ? c0 : s0;
        const double c1 = half != 0.0 ? s0 : c0;
        sine[k] = quadrant >= 2.0 ? -s1 : s1;
        cosine[k] = ((quadrant == 1.0) | (quadrant == 2.0)) ? -c1 : c1;
    }
}

/* end */
/* float */
/* Replaces n angles by their sines, and computes their cosines. x = n pi/2 + r with |r| <= pi/4; n pi/2 is subtracted
 * in three parts (Cody and Waite). Sine and cosine of r are polynomials with the coefficients of Moshier's Cephes
 * library. */
static inline void NAME_sin_cos(int n, float *restrict sine, float *restrict cosine) {
    int far = 0;
    for (int k = 0; k < n; k++) {
        far |= !(fabsf(sine[k]) <= 8192.0f);
    }
    if (far) {
        for (int k = 0; k < n; k++) {
            cosine[k] = cosf(sine[k]);
            sine[k] = sinf(sine[k]);
        }
        return;
    }
    for (int k = 0; k < n; k++) {
        const float x = sine[k];
        const float turns = floorf(x * 0.63661977f + 0.5f);
        float r = x - turns * 1.5703125f;
        r = r - turns * 4.837512969970703e-4f;
        r = r - turns * 7.549789954891882e-8f;
        const float z = r * r;
        float p = -1.9515295891e-4f;
        p = p * z + 8.3321608736e-3f;
        p = p * z + -1.6666654611e-1f;
        float c = 2.443315711809948e-5f;
        c = c * z + -1.388731625493765e-3f;
        c = c * z + 4.166664568298827e-2f;
        const float s0 = p * z * r + r;
        const float c0 = c * z * z + (1.0f - 0.5f * z);
        /* the quadrant, 0 to 3: (sin, cos), (cos, -sin), (-sin, -cos), (-cos, sin) */
        const float quadrant = turns - 4.0f * floorf(turns * 0.25f);
        const float half = quadrant - 2.0f * floorf(quadrant * 0.5f);
        const float s1 = half != 0.0f ? c0 : s0;
        const float c1 = half != 0.0f ? s0 : c0;
        sine[k] = quadrant >= 2.0f ? -s1 : s1;
        cosine[k] = ((quadrant == 1.0f) | (quadrant == 2.0f)) ? -c1 : c1;
    }
}

/* end */
