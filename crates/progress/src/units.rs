//! Parts of a result that are kept as they finish.

use std::fmt;
use std::sync::Arc;

/// Identifies the result of one part of a computation by everything that result depends on.
///
/// Two parts with equal keys must have equal results, so the key must cover every value the part reads: its own
/// slice of the input, the parameters it looks at, and what it takes from other parts. It must *not* cover anything
/// else, or an edit elsewhere makes this part anew. The code itself is not part of it: whoever keeps the results
/// keeps those of another version of the code apart.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UnitKey([u8; 32]);

impl UnitKey {
    /// Begins the key of a part of this `kind` ("edge", "face"); kinds keep the keys of different computations on
    /// equal data apart.
    ///
    /// ```
    /// use topipe_progress::UnitKey;
    /// let of = |points: &[f64]| UnitKey::of("edge").f64s(points).u64(3).finish();
    /// assert_eq!(of(&[0.0, 1.0]), of(&[0.0, 1.0]));
    /// assert_ne!(of(&[0.0, 1.0]), of(&[0.0, 2.0]));
    /// ```
    pub fn of(kind: &str) -> UnitKeyHasher {
        UnitKeyHasher(blake3::Hasher::new()).bytes(kind.as_bytes())
    }

    /// A key from its 32 bytes.
    pub const fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// Its 32 bytes.
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Debug for UnitKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&blake3::Hash::from_bytes(self.0).to_hex()[..12])
    }
}

/// Collects what a [`UnitKey`] is made of. Every field goes in with its length, so that no two different sequences of
/// fields give the same key.
#[derive(Clone)]
#[must_use = "a key is made by `finish`"]
pub struct UnitKeyHasher(blake3::Hasher);

/// Numbers hashed together.
const BLOCK: usize = 2048;

impl UnitKeyHasher {
    /// Adds bytes.
    pub fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// Adds a whole number.
    pub fn u64(self, value: u64) -> Self {
        self.bytes(&value.to_le_bytes())
    }

    /// Adds numbers bit by bit: 0.0 and -0.0 are two values.
    pub fn f64s(mut self, values: &[f64]) -> Self {
        self.0.update(&(values.len() as u64 * 8).to_le_bytes());
        // In blocks of many chunks of the hash, which are hashed side by side.
        let mut bytes = [0u8; 8 * BLOCK];
        for chunk in values.chunks(BLOCK) {
            for (to, value) in bytes.chunks_exact_mut(8).zip(chunk) {
                to.copy_from_slice(&value.to_le_bytes());
            }
            self.0.update(&bytes[..chunk.len() * 8]);
        }
        self
    }

    /// Adds the key of a part whose result this one reads.
    pub fn key(self, key: UnitKey) -> Self {
        self.bytes(&key.0)
    }

    /// The key.
    pub fn finish(&self) -> UnitKey {
        UnitKey(*self.0.finalize().as_bytes())
    }
}

impl fmt::Debug for UnitKeyHasher {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("UnitKeyHasher")
    }
}

/// Keeps finished parts. Called from any thread.
pub trait UnitStore: Send + Sync {
    /// The bytes that were put under this key, exactly as they were put, or nothing.
    fn get(&self, key: UnitKey) -> Option<Vec<u8>>;
    /// Keeps `value`. A store that cannot keep it says so elsewhere; the computation goes on.
    fn put(&self, key: UnitKey, value: &[u8]);
    /// The computation is going to need all of these, so many `what` ("patches").
    fn announce(&self, what: &str, keys: &[UnitKey]);
}

/// The handle a computation is given. Cheap to clone and to share between threads.
///
/// ```
/// use topipe_progress::{UnitKey, Units};
/// fn fit(samples: &[f64]) -> Vec<f64> { samples.iter().map(|x| x / 2.0).collect() }
///
/// let units = Units::none();
/// let patches = [vec![1.0, 2.0], vec![3.0]];
/// let keys: Vec<UnitKey> = patches.iter().map(|samples| UnitKey::of("patch").f64s(samples).finish()).collect();
/// units.announce("patches", &keys);
/// for (samples, key) in patches.iter().zip(keys) {
///     // Computed only where no earlier run has left it.
///     let fitted = units.f64s(key, || Ok::<_, ()>(fit(samples))).unwrap();
///     assert_eq!(fitted.len(), samples.len());
/// }
/// ```
#[derive(Clone, Default)]
pub struct Units {
    store: Option<Arc<dyn UnitStore>>,
}

impl fmt::Debug for Units {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.store.is_some() { "Units(kept)" } else { "Units(none)" })
    }
}

impl Units {
    /// Nothing is kept and nothing is found: every part is computed.
    pub fn none() -> Self {
        Self::default()
    }

    /// Kept by `store`.
    pub fn new(store: Arc<dyn UnitStore>) -> Self {
        Self { store: Some(store) }
    }

    /// Whether anything is kept at all. Where keys are costly to make, ask first.
    pub fn are_kept(&self) -> bool {
        self.store.is_some()
    }

    /// Says which parts will be needed, before the first of them is computed. It lets people be told how many of them
    /// an interrupted run has left. May be called several times, where later keys depend on earlier parts.
    pub fn announce(&self, what: &str, keys: &[UnitKey]) {
        if let Some(store) = &self.store {
            store.announce(what, keys);
        }
    }

    /// What is kept under a key.
    pub fn get(&self, key: UnitKey) -> Option<Vec<u8>> {
        self.store.as_ref()?.get(key)
    }

    /// Keeps the bytes of a finished part. Once this returns, the part survives the death of the process.
    pub fn put(&self, key: UnitKey, value: &[u8]) {
        if let Some(store) = &self.store {
            store.put(key, value);
        }
    }

    /// The numbers kept under a key; where there are none, those that `compute` gives, which are then kept.
    pub fn f64s<E>(
        &self,
        key: UnitKey,
        compute: impl FnOnce() -> Result<Vec<f64>, E>,
    ) -> Result<Vec<f64>, E> {
        let Some(store) = &self.store else { return compute() };
        if let Some(bytes) = store.get(key) {
            let (numbers, rest) = bytes.as_chunks::<8>();
            // Other lengths were put by someone who keeps something else under this key.
            if rest.is_empty() {
                return Ok(numbers.iter().map(|number| f64::from_le_bytes(*number)).collect());
            }
        }
        let numbers = compute()?;
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        store.put(key, &bytes);
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;
    use std::sync::Mutex;

    #[derive(Default)]
    struct Memory(Mutex<HashMap<UnitKey, Vec<u8>>>);

    impl UnitStore for Memory {
        fn get(&self, key: UnitKey) -> Option<Vec<u8>> {
            self.0.lock().unwrap().get(&key).cloned()
        }
        fn put(&self, key: UnitKey, value: &[u8]) {
            self.0.lock().unwrap().insert(key, value.to_vec());
        }
        fn announce(&self, _: &str, _: &[UnitKey]) {}
    }

    #[test]
    fn keys_tell_kinds_fields_and_signs_of_zero_apart() {
        let keys = [
            UnitKey::of("a").finish(),
            UnitKey::of("b").finish(),
            UnitKey::of("a").f64s(&[]).finish(),
            UnitKey::of("a").f64s(&[0.0]).finish(),
            UnitKey::of("a").f64s(&[-0.0]).finish(),
            UnitKey::of("a").f64s(&[0.0, 1.0]).finish(),
            UnitKey::of("a").f64s(&[0.0]).f64s(&[1.0]).finish(),
            UnitKey::of("a").bytes(b"xy").bytes(b"z").finish(),
            UnitKey::of("a").bytes(b"x").bytes(b"yz").finish(),
        ];
        for (at, key) in keys.iter().enumerate() {
            assert!(!keys[..at].contains(key), "{at}");
        }
    }

    #[test]
    fn long_slices_hash_like_their_bytes() {
        let numbers: Vec<f64> = (0..1000).map(|k| f64::from(k).sqrt()).collect();
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        assert_eq!(UnitKey::of("a").f64s(&numbers).finish(), UnitKey::of("a").bytes(&bytes).finish());
    }

    #[test]
    fn a_kept_part_is_not_computed_again_and_comes_back_bit_by_bit() {
        let units = Units::new(Arc::new(Memory::default()));
        let key = UnitKey::of("a").finish();
        let values = vec![0.1, -0.0, f64::MIN_POSITIVE / 2.0, f64::INFINITY];
        let computed = units.f64s(key, || Ok::<_, ()>(values.clone())).unwrap();
        let found = units.f64s(key, || Err(())).unwrap();
        let bits = |numbers: &[f64]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&computed), bits(&values));
        assert_eq!(bits(&found), bits(&values));
        assert_eq!(Units::none().f64s(key, || Err(1)), Err(1));
    }

    #[test]
    fn a_failed_part_is_not_kept() {
        let units = Units::new(Arc::new(Memory::default()));
        let key = UnitKey::of("a").finish();
        assert_eq!(units.f64s(key, || Err(7)), Err(7));
        assert_eq!(units.get(key), None);
    }
}
