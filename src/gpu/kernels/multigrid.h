// The coarse levels of multigrid, and the filter of cubic B-splines (`solver/preconditioner/multigrid/`).

// Places of a stencil.
#define PLACES 27

struct Stencil {
    // By place, then node: the neighbour, and the block of K, column by column.
    const u32 *neighbours;
    const double *entries;
    // Values that are zero; none where values follow others, which `clear_fixed` does after them.
    const u8 *held;
    const double *x;
    double *y;
    i64 nodes;
    int dimension;
};

// y = K x of a coarse level.
KERNEL(stencil, Stencil) {
    PHASE(t) {
        const i64 node = ITEM(t), d = a.dimension;
        if (node < a.nodes) {
            double sum[3] = {0.0, 0.0, 0.0};
            for (int place = 0; place < PLACES; place++) {
                const u32 other = a.neighbours[place * a.nodes + node];
                if (other == NONE) continue;
                const double *block = a.entries + place * d * d * a.nodes + node, *x = a.x + other * d;
                for (int i = 0; i < d; i++) {
                    double product = block[i * a.nodes] * x[0];
                    for (int k = 1; k < d; k++) product += block[(k * d + i) * a.nodes] * x[k];
                    sum[i] += product;
                }
            }
            for (int i = 0; i < d; i++) a.y[node * d + i] = a.held && a.held[node * d + i] ? 0.0 : sum[i];
        }
    }
}

struct Interpolation {
    // The coarse nodes around each finer node, and the finer nodes within reach of each coarse node.
    const u32 *around_first;
    const u32 *around;
    const u32 *within_first;
    const u32 *within;
    // Finer values that are no unknowns, and coarse values that are zero; the latter none where values follow others.
    const u8 *fixed;
    const u8 *held;
    const double *x;
    double *y;
    i64 n;
    int dimension;
};

FUNCTION double interpolation_weight(const struct Interpolation *a, i64 fine) {
    return 1.0 / (double)(a->around_first[fine + 1] - a->around_first[fine]);
}

// y = Pᵀ x
KERNEL(restrict_to_coarse, Interpolation) {
    PHASE(t) {
        const i64 i = ITEM(t), node = i / a.dimension, c = i % a.dimension;
        if (i < a.n) {
            double sum = 0.0;
            for (u32 k = a.within_first[node]; k < a.within_first[node + 1]; k++) {
                const i64 fine = a.within[k], at = fine * a.dimension + c;
                if (!a.fixed[at]) sum += interpolation_weight(&a, fine) * a.x[at];
            }
            a.y[i] = a.held && a.held[i] ? 0.0 : sum;
        }
    }
}

// y += P x
KERNEL(prolong_to_fine, Interpolation) {
    PHASE(t) {
        const i64 i = ITEM(t), node = i / a.dimension, c = i % a.dimension;
        if (i < a.n && !a.fixed[i]) {
            double sum = a.y[i];
            for (u32 k = a.around_first[node]; k < a.around_first[node + 1]; k++)
                sum += interpolation_weight(&a, node) * a.x[(i64)a.around[k] * a.dimension + c];
            a.y[i] = sum;
        }
    }
}

struct Filter {
    // For each node, the neighbours before and behind it along an axis.
    const u32 *before;
    const u32 *behind;
    const double *scale;
    // The field that is filtered, and the arrays of the iteration.
    const double *given;
    double *x;
    double *r;
    double *p;
    double *out;
    double a;
    double b;
    i64 n;
    int dimension;
};

// x = scale · given
KERNEL(filter_begin, Filter) {
    PHASE(t) {
        const i64 i = ITEM(t);
        if (i < a.n) a.x[i] = a.given[i] * a.scale[i];
    }
}

// r = x, x = p = x/a: the start of the iteration for B⁻¹, B = [1 4 1]/6.
KERNEL(filter_start, Filter) {
    PHASE(t) {
        const i64 i = ITEM(t);
        if (i < a.n) {
            a.r[i] = a.x[i];
            a.x[i] = a.p[i] = a.x[i] / a.a;
        }
    }
}

// r −= B p
KERNEL(filter_residual, Filter) {
    PHASE(t) {
        const i64 i = ITEM(t), node = i / a.dimension, c = i % a.dimension;
        if (i < a.n) {
            double others = 0.0;
            if (a.before[node] != NONE) others += a.p[(i64)a.before[node] * a.dimension + c];
            if (a.behind[node] != NONE) others += a.p[(i64)a.behind[node] * a.dimension + c];
            a.r[i] -= (a.p[i] * 4.0 + others) / 6.0;
        }
    }
}

// p = a p + b r, x += p
KERNEL(filter_update, Filter) {
    PHASE(t) {
        const i64 i = ITEM(t);
        if (i < a.n) {
            const double p = a.p[i] * a.a + a.r[i] * a.b;
            a.p[i] = p;
            a.x[i] += p;
        }
    }
}

// out += a scale · x
KERNEL(filter_end, Filter) {
    PHASE(t) {
        const i64 i = ITEM(t);
        if (i < a.n) a.out[i] += a.x[i] * a.scale[i] * a.a;
    }
}
