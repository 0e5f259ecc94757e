// The few vector operations that extraction needs, for AVX2, NEON, and any other CPU (plain loops; also chosen by
// TESSERA_SIMD_PLAIN). All are integer operations that give the same bits everywhere.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__AVX2__) && !defined(TESSERA_SIMD_PLAIN)
#include <immintrin.h>
#define TESSERA_SIMD_AVX2
#elif defined(__ARM_NEON) && defined(__aarch64__) && !defined(TESSERA_SIMD_PLAIN)
#include <arm_neon.h>
#define TESSERA_SIMD_NEON
#endif

namespace tessera::simd {

#if defined(TESSERA_SIMD_AVX2)

struct U8x32 {
  __m256i v;
};
struct U16x16 {
  __m256i v;
};

inline U8x32 Load8(const uint8_t* p) { return {_mm256_loadu_si256(reinterpret_cast<const __m256i*>(p))}; }
inline void Store(uint8_t* p, U8x32 a) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), a.v); }
inline U8x32 Fill8(uint8_t value) { return {_mm256_set1_epi8(static_cast<char>(value))}; }
// (a + b) mod 256
inline U8x32 Add(U8x32 a, U8x32 b) { return {_mm256_add_epi8(a.v, b.v)}; }
// min(a + b, 255)
inline U8x32 AddSaturated(U8x32 a, U8x32 b) { return {_mm256_adds_epu8(a.v, b.v)}; }
// max(a - b, 0)
inline U8x32 SubtractSaturated(U8x32 a, U8x32 b) { return {_mm256_subs_epu8(a.v, b.v)}; }
inline U8x32 Min(U8x32 a, U8x32 b) { return {_mm256_min_epu8(a.v, b.v)}; }
inline U8x32 Max(U8x32 a, U8x32 b) { return {_mm256_max_epu8(a.v, b.v)}; }
// (a + b + 1) / 2
inline U8x32 Average(U8x32 a, U8x32 b) { return {_mm256_avg_epu8(a.v, b.v)}; }
inline U8x32 And(U8x32 a, U8x32 b) { return {_mm256_and_si256(a.v, b.v)}; }
inline bool AllZero(U8x32 a) { return _mm256_testz_si256(a.v, a.v) != 0; }
// Bit i is set where a[i] > b[i].
inline uint32_t GreaterMask(U8x32 a, U8x32 b) {
  const __m256i not_greater = _mm256_cmpeq_epi8(_mm256_subs_epu8(a.v, b.v), _mm256_setzero_si256());
  return ~static_cast<uint32_t>(_mm256_movemask_epi8(not_greater));
}

inline U16x16 Load16(const uint16_t* p) { return {_mm256_loadu_si256(reinterpret_cast<const __m256i*>(p))}; }
inline void Store(uint16_t* p, U16x16 a) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), a.v); }
inline U16x16 Fill16(uint16_t value) { return {_mm256_set1_epi16(static_cast<int16_t>(value))}; }
inline U16x16 Add(U16x16 a, U16x16 b) { return {_mm256_add_epi16(a.v, b.v)}; }
inline U16x16 Subtract(U16x16 a, U16x16 b) { return {_mm256_sub_epi16(a.v, b.v)}; }
// The low 16 bits of each product.
inline U16x16 MultiplyLow(U16x16 a, U16x16 b) { return {_mm256_mullo_epi16(a.v, b.v)}; }
// The high 16 bits of each product.
inline U16x16 MultiplyHigh(U16x16 a, U16x16 b) { return {_mm256_mulhi_epu16(a.v, b.v)}; }
template <int kBits>
inline U16x16 ShiftRight(U16x16 a) {
  return {_mm256_srli_epi16(a.v, kBits)};
}
// The bytes with even or odd index, widened.
inline U16x16 EvenBytes(U8x32 a) { return {_mm256_and_si256(a.v, _mm256_set1_epi16(0x00FF))}; }
inline U16x16 OddBytes(U8x32 a) { return {_mm256_srli_epi16(a.v, 8)}; }
// The sixteen values of a, then those of b, all <= 255.
inline U8x32 Narrow(U16x16 a, U16x16 b) { return {_mm256_permute4x64_epi64(_mm256_packus_epi16(a.v, b.v), 0xD8)}; }
// Sum of the products of signed values; must fit 32 bits.
inline int32_t SignedDot(U16x16 a, U16x16 b) {
  const __m256i products = _mm256_madd_epi16(a.v, b.v);
  __m128i sum = _mm_add_epi32(_mm256_castsi256_si128(products), _mm256_extracti128_si256(products, 1));
  sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0x4E));
  sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0xB1));
  return _mm_cvtsi128_si32(sum);
}
// Eight weighted pairs from each of two positions:
//   out_low[i] = low[pairs[2i]] * weights[2i] + low[pairs[2i+1]] * weights[2i+1], out_high likewise, i = 0..7;
// pairs < 16, weights < 128.
inline void WeightedPairs(const uint8_t* low, const uint8_t* high, const uint8_t* pairs, const uint8_t* weights,
                          uint16_t* out_low, uint16_t* out_high) {
  const auto load = [](const uint8_t* p) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(p)); };
  const __m256i both = _mm256_inserti128_si256(_mm256_castsi128_si256(load(low)), load(high), 1);
  const __m256i chosen = _mm256_shuffle_epi8(both, _mm256_broadcastsi128_si256(load(pairs)));
  const __m256i sums = _mm256_maddubs_epi16(chosen, _mm256_broadcastsi128_si256(load(weights)));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(out_low), _mm256_castsi256_si128(sums));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(out_high), _mm256_extracti128_si256(sums, 1));
}

#elif defined(TESSERA_SIMD_NEON)

struct U8x32 {
  uint8x16_t low, high;
};
struct U16x16 {
  uint16x8_t low, high;
};

inline U8x32 Load8(const uint8_t* p) { return {vld1q_u8(p), vld1q_u8(p + 16)}; }
inline void Store(uint8_t* p, U8x32 a) {
  vst1q_u8(p, a.low);
  vst1q_u8(p + 16, a.high);
}
inline U8x32 Fill8(uint8_t value) { return {vdupq_n_u8(value), vdupq_n_u8(value)}; }
inline U8x32 Add(U8x32 a, U8x32 b) { return {vaddq_u8(a.low, b.low), vaddq_u8(a.high, b.high)}; }
inline U8x32 AddSaturated(U8x32 a, U8x32 b) { return {vqaddq_u8(a.low, b.low), vqaddq_u8(a.high, b.high)}; }
inline U8x32 SubtractSaturated(U8x32 a, U8x32 b) { return {vqsubq_u8(a.low, b.low), vqsubq_u8(a.high, b.high)}; }
inline U8x32 Min(U8x32 a, U8x32 b) { return {vminq_u8(a.low, b.low), vminq_u8(a.high, b.high)}; }
inline U8x32 Max(U8x32 a, U8x32 b) { return {vmaxq_u8(a.low, b.low), vmaxq_u8(a.high, b.high)}; }
inline U8x32 Average(U8x32 a, U8x32 b) { return {vrhaddq_u8(a.low, b.low), vrhaddq_u8(a.high, b.high)}; }
inline U8x32 And(U8x32 a, U8x32 b) { return {vandq_u8(a.low, b.low), vandq_u8(a.high, b.high)}; }
inline bool AllZero(U8x32 a) { return vmaxvq_u8(vorrq_u8(a.low, a.high)) == 0; }
inline uint32_t GreaterMask(U8x32 a, U8x32 b) {
  const uint8x16_t bits = {1, 2, 4, 8, 16, 32, 64, 128, 1, 2, 4, 8, 16, 32, 64, 128};
  const auto mask = [&bits](uint8x16_t x, uint8x16_t y) {
    const uint8x16_t set = vandq_u8(vcgtq_u8(x, y), bits);
    return static_cast<uint32_t>(vaddv_u8(vget_low_u8(set))) | static_cast<uint32_t>(vaddv_u8(vget_high_u8(set))) << 8;
  };
  return mask(a.low, b.low) | mask(a.high, b.high) << 16;
}

inline U16x16 Load16(const uint16_t* p) { return {vld1q_u16(p), vld1q_u16(p + 8)}; }
inline void Store(uint16_t* p, U16x16 a) {
  vst1q_u16(p, a.low);
  vst1q_u16(p + 8, a.high);
}
inline U16x16 Fill16(uint16_t value) { return {vdupq_n_u16(value), vdupq_n_u16(value)}; }
inline U16x16 Add(U16x16 a, U16x16 b) { return {vaddq_u16(a.low, b.low), vaddq_u16(a.high, b.high)}; }
inline U16x16 Subtract(U16x16 a, U16x16 b) { return {vsubq_u16(a.low, b.low), vsubq_u16(a.high, b.high)}; }
inline U16x16 MultiplyLow(U16x16 a, U16x16 b) { return {vmulq_u16(a.low, b.low), vmulq_u16(a.high, b.high)}; }
inline U16x16 MultiplyHigh(U16x16 a, U16x16 b) {
  const auto high = [](uint16x8_t x, uint16x8_t y) {
    return vcombine_u16(vshrn_n_u32(vmull_u16(vget_low_u16(x), vget_low_u16(y)), 16),
                        vshrn_n_u32(vmull_u16(vget_high_u16(x), vget_high_u16(y)), 16));
  };
  return {high(a.low, b.low), high(a.high, b.high)};
}
template <int kBits>
inline U16x16 ShiftRight(U16x16 a) {
  return {vshrq_n_u16(a.low, kBits), vshrq_n_u16(a.high, kBits)};
}
inline U16x16 EvenBytes(U8x32 a) {
  const uint16x8_t mask = vdupq_n_u16(0x00FF);
  return {vandq_u16(vreinterpretq_u16_u8(a.low), mask), vandq_u16(vreinterpretq_u16_u8(a.high), mask)};
}
inline U16x16 OddBytes(U8x32 a) {
  return {vshrq_n_u16(vreinterpretq_u16_u8(a.low), 8), vshrq_n_u16(vreinterpretq_u16_u8(a.high), 8)};
}
inline U8x32 Narrow(U16x16 a, U16x16 b) {
  return {vcombine_u8(vmovn_u16(a.low), vmovn_u16(a.high)), vcombine_u8(vmovn_u16(b.low), vmovn_u16(b.high))};
}
inline int32_t SignedDot(U16x16 a, U16x16 b) {
  const auto add = [](int32x4_t sum, uint16x8_t x, uint16x8_t y) {
    const int16x8_t signed_x = vreinterpretq_s16_u16(x);
    const int16x8_t signed_y = vreinterpretq_s16_u16(y);
    sum = vmlal_s16(sum, vget_low_s16(signed_x), vget_low_s16(signed_y));
    return vmlal_s16(sum, vget_high_s16(signed_x), vget_high_s16(signed_y));
  };
  return vaddvq_s32(add(add(vdupq_n_s32(0), a.low, b.low), a.high, b.high));
}
inline void WeightedPairs(const uint8_t* low, const uint8_t* high, const uint8_t* pairs, const uint8_t* weights,
                          uint16_t* out_low, uint16_t* out_high) {
  const uint8x16_t index = vld1q_u8(pairs);
  const uint8x16_t weight = vld1q_u8(weights);
  const auto weigh = [&index, &weight](const uint8_t* p) {
    const uint8x16_t chosen = vqtbl1q_u8(vld1q_u8(p), index);
    return vpaddq_u16(vmull_u8(vget_low_u8(chosen), vget_low_u8(weight)),
                      vmull_u8(vget_high_u8(chosen), vget_high_u8(weight)));
  };
  vst1q_u16(out_low, weigh(low));
  vst1q_u16(out_high, weigh(high));
}

#else

struct U8x32 {
  uint8_t v[32];
};
struct U16x16 {
  uint16_t v[16];
};

template <class Operation>
inline U8x32 Map8(Operation operation) {
  U8x32 result;
  for (int i = 0; i < 32; ++i) result.v[i] = static_cast<uint8_t>(operation(i));
  return result;
}
template <class Operation>
inline U16x16 Map16(Operation operation) {
  U16x16 result;
  for (int i = 0; i < 16; ++i) result.v[i] = static_cast<uint16_t>(operation(i));
  return result;
}

inline U8x32 Load8(const uint8_t* p) {
  U8x32 result;
  std::memcpy(result.v, p, sizeof(result.v));
  return result;
}
inline void Store(uint8_t* p, U8x32 a) { std::memcpy(p, a.v, sizeof(a.v)); }
inline U8x32 Fill8(uint8_t value) {
  return Map8([value](int) { return value; });
}
inline U8x32 Add(U8x32 a, U8x32 b) {
  return Map8([&](int i) { return a.v[i] + b.v[i]; });
}
inline U8x32 AddSaturated(U8x32 a, U8x32 b) {
  return Map8([&](int i) { return a.v[i] + b.v[i] < 255 ? a.v[i] + b.v[i] : 255; });
}
inline U8x32 SubtractSaturated(U8x32 a, U8x32 b) {
  return Map8([&](int i) { return a.v[i] > b.v[i] ? a.v[i] - b.v[i] : 0; });
}
inline U8x32 Min(U8x32 a, U8x32 b) {
  return Map8([&](int i) { return a.v[i] < b.v[i] ? a.v[i] : b.v[i]; });
}
inline U8x32 Max(U8x32 a, U8x32 b) {
  return Map8([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
}
inline U8x32 Average(U8x32 a, U8x32 b) {
  return Map8([&](int i) { return (a.v[i] + b.v[i] + 1) >> 1; });
}
inline U8x32 And(U8x32 a, U8x32 b) {
  return Map8([&](int i) { return a.v[i] & b.v[i]; });
}
inline bool AllZero(U8x32 a) {
  uint32_t any = 0;
  for (const uint8_t value : a.v) any |= value;
  return any == 0;
}
inline uint32_t GreaterMask(U8x32 a, U8x32 b) {
  uint32_t mask = 0;
  for (int i = 0; i < 32; ++i) mask |= static_cast<uint32_t>(a.v[i] > b.v[i]) << i;
  return mask;
}

inline U16x16 Load16(const uint16_t* p) {
  U16x16 result;
  std::memcpy(result.v, p, sizeof(result.v));
  return result;
}
inline void Store(uint16_t* p, U16x16 a) { std::memcpy(p, a.v, sizeof(a.v)); }
inline U16x16 Fill16(uint16_t value) {
  return Map16([value](int) { return value; });
}
inline U16x16 Add(U16x16 a, U16x16 b) {
  return Map16([&](int i) { return a.v[i] + b.v[i]; });
}
inline U16x16 Subtract(U16x16 a, U16x16 b) {
  return Map16([&](int i) { return a.v[i] - b.v[i]; });
}
inline U16x16 MultiplyLow(U16x16 a, U16x16 b) {
  return Map16([&](int i) { return uint32_t{a.v[i]} * b.v[i]; });
}
inline U16x16 MultiplyHigh(U16x16 a, U16x16 b) {
  return Map16([&](int i) { return uint32_t{a.v[i]} * b.v[i] >> 16; });
}
template <int kBits>
inline U16x16 ShiftRight(U16x16 a) {
  return Map16([&](int i) { return a.v[i] >> kBits; });
}
inline U16x16 EvenBytes(U8x32 a) {
  return Map16([&](int i) { return a.v[2 * i]; });
}
inline U16x16 OddBytes(U8x32 a) {
  return Map16([&](int i) { return a.v[2 * i + 1]; });
}
inline U8x32 Narrow(U16x16 a, U16x16 b) {
  return Map8([&](int i) { return i < 16 ? a.v[i] : b.v[i - 16]; });
}
inline int32_t SignedDot(U16x16 a, U16x16 b) {
  int32_t sum = 0;
  for (int i = 0; i < 16; ++i) sum += static_cast<int16_t>(a.v[i]) * static_cast<int16_t>(b.v[i]);
  return sum;
}
inline void WeightedPairs(const uint8_t* low, const uint8_t* high, const uint8_t* pairs, const uint8_t* weights,
                          uint16_t* out_low, uint16_t* out_high) {
  for (int i = 0; i < 8; ++i) {
    const auto weigh = [&](const uint8_t* p) {
      return static_cast<uint16_t>(p[pairs[2 * i]] * weights[2 * i] + p[pairs[2 * i + 1]] * weights[2 * i + 1]);
    };
    out_low[i] = weigh(low);
    out_high[i] = weigh(high);
  }
}

#endif

}  // namespace tessera::simd
