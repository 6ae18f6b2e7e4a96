package org.camssf.passport

/**
 * Signs with a key that the app holds, for example one that needs user authentication
 * (`BiometricPrompt.CryptoObject`).
 */
public fun interface PassportSigner {
    /**
     * Signature of [data] by SHA256withECDSA, in DER, as `java.security.Signature.sign` returns it. Its exceptions
     * reach the caller of [Passport.sign].
     */
    public fun sign(data: ByteArray): ByteArray
}
