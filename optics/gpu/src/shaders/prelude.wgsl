// Complex numbers, and the phasor of a phase.

fn turned(a: vec2f) -> vec2f { return vec2f(-a.y, a.x); }
fn turned_back(a: vec2f) -> vec2f { return vec2f(a.y, -a.x); }
fn times(a: vec2f, b: vec2f) -> vec2f { return vec2f(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }
// a times the conjugate of b.
fn times_conj(a: vec2f, b: vec2f) -> vec2f { return vec2f(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y); }

// e^{i phase} by polynomials on -pi/4 to pi/4, from the phase minus its quarter turns in two parts. The language's own
// sine and cosine promise an error of 2^-11 only. Signs and the exchange of sine and cosine are bit operations, which
// take fewer registers than choices.
fn cis(phase: f32) -> vec2f {
  let k = round(phase * 0.63661977236f);
  let r = fma(k, 4.37113900018624283e-8f, fma(k, -1.57079637050628662f, phase));
  let z = r * r;
  let s = r + r * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
  let c = 1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
  let q = bitcast<u32>(k + 12582912.0f);
  let sine = bitcast<u32>(s);
  let cosine = bitcast<u32>(c);
  let exchanged = (sine ^ cosine) & (0u - (q & 1u));
  return vec2f(
    bitcast<f32>((cosine ^ exchanged) ^ (((q + 1u) & 2u) << 30u)),
    bitcast<f32>((sine ^ exchanged) ^ ((q & 2u) << 30u)),
  );
}
