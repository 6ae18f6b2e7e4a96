package androidx.activity;

import android.app.Activity;
import androidx.lifecycle.LifecycleOwner;

/** An activity with a lifecycle. */
public class ComponentActivity extends Activity implements LifecycleOwner {
}
