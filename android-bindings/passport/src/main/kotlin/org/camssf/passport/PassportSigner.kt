package org.camssf.passport

/** Signs with a key that the app holds: for keys that want their user first, through `BiometricPrompt.CryptoObject`. */
public fun interface PassportSigner {
    /** SHA256withECDSA of [data], in DER, as `java.security.Signature.sign` returns it. What this throws goes through. */
    public fun sign(data: ByteArray): ByteArray
}
