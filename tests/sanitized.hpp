// ISM_TEST_SANITIZED: the program is built with a sanitizer, which takes memory, stack and time of
// its own.

#ifndef ISM_TEST_SANITIZED_HPP
#define ISM_TEST_SANITIZED_HPP

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define ISM_TEST_SANITIZED
#endif
#elif defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ISM_TEST_SANITIZED
#endif

#endif
