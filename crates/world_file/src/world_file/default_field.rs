//! Fields that a text omits.

/// Returns whether a field has the default of its type, and its text can omit it.
pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
