//! Rooms: textures and buffers that passes write into, kept as long as they serve.

/// What is there if it serves, else what `make` makes once the old is gone, so that a pool may lend its memory again.
pub fn keep<T>(room: &mut Option<T>, serves: impl FnOnce(&T) -> bool, make: impl FnOnce() -> T) -> &mut T {
    if !room.as_ref().is_some_and(serves) {
        *room = None;
    }
    room.get_or_insert_with(make)
}
