// Verifies passports as docs/passport.md says, with java.security alone: java PassportJudge.java KEY.pem PASSPORT...
// Says valid or invalid, one line a passport. Only the signature: neither the time nor what was called back.

import java.math.BigInteger;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.security.KeyFactory;
import java.security.PublicKey;
import java.security.Signature;
import java.security.spec.X509EncodedKeySpec;
import java.util.Arrays;
import java.util.Base64;

public class PassportJudge {
    private static final BigInteger ORDER =
        new BigInteger("FFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551", 16);

    public static void main(String[] files) throws Exception {
        String pem = Files.readString(Path.of(files[0])).replaceAll("-----[A-Z ]+-----", "").replaceAll("\\s", "");
        PublicKey key = KeyFactory.getInstance("EC")
            .generatePublic(new X509EncodedKeySpec(Base64.getDecoder().decode(pem)));
        for (String file : Arrays.copyOfRange(files, 1, files.length)) {
            System.out.println(holds(Files.readAllBytes(Path.of(file)), key) ? "valid" : "invalid");
        }
    }

    private static boolean holds(byte[] data, PublicKey key) throws Exception {
        String text = new String(data, StandardCharsets.US_ASCII);
        String[] parts = text.split("\\.", -1);
        if (parts.length != 3) return false;
        byte[] both = Base64.getUrlDecoder().decode(parts[2]);
        if (both.length != 64 || !Base64.getUrlEncoder().withoutPadding().encodeToString(both).equals(parts[2])) {
            return false;
        }
        BigInteger r = new BigInteger(1, Arrays.copyOf(both, 32));
        BigInteger s = new BigInteger(1, Arrays.copyOfRange(both, 32, 64));
        if (r.signum() == 0 || s.signum() == 0 || r.compareTo(ORDER) >= 0 || s.compareTo(ORDER) >= 0) {
            return false;
        }
        Signature signature = Signature.getInstance("SHA256withECDSA");
        signature.initVerify(key);
        signature.update(data, 0, text.lastIndexOf('.'));
        return signature.verify(der(r, s));
    }

    /** SEQUENCE of two INTEGERs; neither is longer than 33 bytes. */
    private static byte[] der(BigInteger r, BigInteger s) {
        byte[] a = r.toByteArray(), b = s.toByteArray(), out = new byte[6 + a.length + b.length];
        out[0] = 0x30;
        out[1] = (byte) (4 + a.length + b.length);
        out[2] = 0x02;
        out[3] = (byte) a.length;
        System.arraycopy(a, 0, out, 4, a.length);
        out[4 + a.length] = 0x02;
        out[5 + a.length] = (byte) b.length;
        System.arraycopy(b, 0, out, 6 + a.length, b.length);
        return out;
    }
}
