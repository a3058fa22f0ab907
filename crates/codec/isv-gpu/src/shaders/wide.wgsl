// Signed numbers of 64 bits, the lower word first.

fn wide_add(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn wide_negate(a: vec2<u32>) -> vec2<u32> {
    return wide_add(~a, vec2<u32>(1u, 0u));
}

fn wide_of(a: i32) -> vec2<u32> {
    return vec2<u32>(bitcast<u32>(a), bitcast<u32>(a >> 31u));
}

/// Product of two unsigned words.
fn wide_multiply_unsigned(a: u32, b: u32) -> vec2<u32> {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let cross_a = (a >> 16u) * (b & 0xffffu);
    let cross_b = (a & 0xffffu) * (b >> 16u);
    let middle = (low >> 16u) + (cross_a & 0xffffu) + (cross_b & 0xffffu);
    let high = (a >> 16u) * (b >> 16u) + (cross_a >> 16u) + (cross_b >> 16u) + (middle >> 16u);
    return vec2<u32>((middle << 16u) | (low & 0xffffu), high);
}

/// Product of a signed word and an unsigned one of at most 2^31.
fn wide_multiply_mixed(a: i32, b: u32) -> vec2<u32> {
    // The magnitude of the least number is right as an unsigned one.
    let product = wide_multiply_unsigned(bitcast<u32>(abs(a)), b);
    if a < 0 {
        return wide_negate(product);
    }
    return product;
}

fn wide_multiply(a: i32, b: i32) -> vec2<u32> {
    let product = wide_multiply_unsigned(bitcast<u32>(abs(a)), bitcast<u32>(abs(b)));
    if (a ^ b) < 0 {
        return wide_negate(product);
    }
    return product;
}

/// Rounds half up and drops 1 to 62 bits.
fn wide_round_shift(a: vec2<u32>, shift: u32) -> vec2<u32> {
    let half = shift - 1u;
    let sum = wide_add(a, select(vec2<u32>(0u, 1u << (half & 31u)), vec2<u32>(1u << (half & 31u), 0u), half < 32u));
    let high = bitcast<i32>(sum.y);
    if shift >= 32u {
        return wide_of(high >> (shift - 32u));
    }
    return vec2<u32>((sum.x >> shift) | (sum.y << (32u - shift)), bitcast<u32>(high >> shift));
}

/// The nearest signed word.
fn wide_saturate(a: vec2<u32>) -> i32 {
    let word = bitcast<i32>(a.x);
    if bitcast<i32>(a.y) == (word >> 31u) {
        return word;
    }
    return select(2147483647, -2147483647 - 1, bitcast<i32>(a.y) < 0);
}
