// Operations on long vectors, with the sums of `space/vector.rs`: eight accumulators a chunk, then the chunks in order.

// Entries per partial sum.
#define CHUNK 2048
// Accumulators of a chunk, a thread each.
#define ACCUMULATORS 8

struct Update {
    const double *x;
    double *y;
    double a;
    double b;
    i64 n;
};

// y ← a x + y
KERNEL(axpy, Update) {
    PHASE(t) {
        i64 i = ITEM(t);
        if (i < a.n) a.y[i] = a.a * a.x[i] + a.y[i];
    }
}

// y ← x + b y
KERNEL(xpby, Update) {
    PHASE(t) {
        i64 i = ITEM(t);
        if (i < a.n) a.y[i] = a.x[i] + a.b * a.y[i];
    }
}

// y ← a x
KERNEL(scaled, Update) {
    PHASE(t) {
        i64 i = ITEM(t);
        if (i < a.n) a.y[i] = a.a * a.x[i];
    }
}

// A thread block sums a chunk; the processor adds the chunks, in order. All threads write the chunk's numbers to shared memory. Then each accumulator adds every eighth of them, in
// order, and the accumulators are added.
FUNCTION double accumulate(const double *numbers, int t, i64 left) {
    double sum = 0.0;
    if (left >= CHUNK) {
        UNROLL for (int k = t; k < CHUNK; k += ACCUMULATORS) sum += numbers[k];
    } else {
        for (int k = t; k < left; k += ACCUMULATORS) sum += numbers[k];
    }
    return sum;
}

FUNCTION double add_accumulators(const double *sums) {
    double sum = sums[0];
    for (int k = 1; k < ACCUMULATORS; k++) sum += sums[k];
    return sum;
}

struct Dot {
    const double *x;
    const double *y;
    double *partial;
    i64 n;
};

// The partial sums of x·y.
KERNEL(dot, Dot) {
    SHARED(double, numbers);
    double *sums = numbers + CHUNK;
    const i64 start = (i64)BLOCK * CHUNK;
    PHASE(t) {
        for (i64 k = t; k < CHUNK && start + k < a.n; k += THREADS) numbers[k] = a.x[start + k] * a.y[start + k];
    }
    PHASE(t) {
        if (t < ACCUMULATORS) sums[t] = accumulate(numbers, t, a.n - start);
    }
    PHASE(t) {
        if (t == 0) a.partial[BLOCK] = add_accumulators(sums);
    }
}

struct Advance {
    const double *p;
    const double *q;
    const double *x;
    double *next;
    double *r;
    double *partial;
    double a;
    i64 n;
};

// next ← x + a p, r ← r − a q, and the partial sums of r·r: a step of conjugate gradients.
KERNEL(advance, Advance) {
    SHARED(double, numbers);
    double *sums = numbers + CHUNK;
    const i64 start = (i64)BLOCK * CHUNK;
    PHASE(t) {
        for (i64 k = t; k < CHUNK && start + k < a.n; k += THREADS) {
            const i64 i = start + k;
            a.next[i] = a.x[i] + a.a * a.p[i];
            const double r = a.r[i] - a.a * a.q[i];
            a.r[i] = r;
            numbers[k] = r * r;
        }
    }
    PHASE(t) {
        if (t < ACCUMULATORS) sums[t] = accumulate(numbers, t, a.n - start);
    }
    PHASE(t) {
        if (t == 0) a.partial[BLOCK] = add_accumulators(sums);
    }
}

struct Blocks {
    const double *blocks;
    const double *r;
    double *z;
    i64 n;
    int dimension;
};

// z = M r for a matrix M of diagonal blocks, stored column by column.
KERNEL(multiply_blocks, Blocks) {
    PHASE(t) {
        i64 i = ITEM(t);
        if (i < a.n) {
            int d = a.dimension, row = (int)(i % d);
            const double *block = a.blocks + i / d * d * d + row, *r = a.r + i / d * d;
            double sum = block[0] * r[0];
            for (int k = 1; k < d; k++) sum += block[k * d] * r[k];
            a.z[i] = sum;
        }
    }
}

// y ← x / a
KERNEL(divided, Update) {
    PHASE(t) {
        i64 i = ITEM(t);
        if (i < a.n) a.y[i] = a.x[i] / a.a;
    }
}

// y ← b y + a x
KERNEL(axpby, Update) {
    PHASE(t) {
        i64 i = ITEM(t);
        if (i < a.n) a.y[i] = a.b * a.y[i] + a.a * a.x[i];
    }
}

struct Move {
    const double *p;
    const double *q;
    double *x;
    double *r;
    i64 n;
};

// x ← x + p, r ← r − q
KERNEL(move_along, Move) {
    PHASE(t) {
        i64 i = ITEM(t);
        if (i < a.n) {
            a.x[i] += a.p[i];
            a.r[i] -= a.q[i];
        }
    }
}
