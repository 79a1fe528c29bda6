//! Assignment operators such as `+=`, derived from `+` and `−`.

macro_rules! operators {
    ($type:ty $(, $($of:tt)*)?) => {
        impl $(<$($of)*>)? AddAssign for $type {
            #[inline(always)]
            fn add_assign(&mut self, o: Self) {
                *self = *self + o;
            }
        }
        impl $(<$($of)*>)? SubAssign for $type {
            #[inline(always)]
            fn sub_assign(&mut self, o: Self) {
                *self = *self - o;
            }
        }
    };
}
pub(crate) use operators;
